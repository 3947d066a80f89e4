"""A running service for tests and benchmarks: the command in a process of its own, and a client for it."""

from __future__ import annotations

import base64
import json
import os
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warp_cloth.scene.shapes import SphereShape
from warp_cloth.serve.scratch import PREFIX
from warp_cloth.shapes import build_avatar

# a cloth on a ball, of some hundredths of a second
CHEAP = """
scene = "sphere"
garment.shape.vertices_per_side = 7
collision.pixel_mm = 10
collision.avatar = "mesh"
solver.iterations = 300
[product]
garments = [{name = "cloth"}]
sizes = [
  {name = "S", garment.shape.side = 0.5},
  {name = "M", garment.shape.side = 0.6},
  {name = "L", garment.shape.side = 0.7},
]
"""
CHEAP_CHANGES = (
    "garment.shape.vertices_per_side=7",
    "collision.pixel_mm=10",
    'collision.avatar="mesh"',
    "solver.iterations=300",
)
SIDES = {"S": 0.5, "M": 0.6, "L": 0.7}


def ball(radius: float) -> bytes:
    """A ball below the cloth, as an .obj file in metres."""
    mesh = build_avatar(SphereShape(kind="sphere", radius=radius, centre=(0.0, 0.6, 0.0), edge_mm=80))
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in np.round(mesh.points, 6).tolist()]
    lines += ["f {} {} {}".format(*corners) for corners in (mesh.triangles + 1).tolist()]
    return "\n".join(lines).encode()


def square_cloth(side: float = 0.3, height: float = 0.86, count: int = 9) -> bytes:
    """A flat square of ``count`` vertices a side above that ball, as an .obj file in metres."""
    ticks = np.linspace(-0.5 * side, 0.5 * side, count).tolist()
    lines = [f"v {x!r} {height!r} {z!r}" for z in ticks for x in ticks]
    for first in (count * row + column + 1 for row in range(count - 1) for column in range(count - 1)):
        below = first + count
        lines += [f"f {first} {below} {first + 1}", f"f {first + 1} {below} {below + 1}"]
    return "\n".join(lines).encode()


def mesh_file(data: bytes, kind: str = "obj") -> dict[str, str]:
    return {"data": base64.b64encode(data).decode(), "format": kind, "units": "m"}


@dataclass(frozen=True)
class Running:
    """A service that runs."""

    address: str
    process: subprocess.Popen[str]
    scratch: Path  # the folder of its requests' files

    def get(self, path: str) -> tuple[int, Any]:
        return self._answer(urllib.request.Request(self.address + path))

    def post(self, content: Any, kind: str = "application/json") -> tuple[int, Any]:
        data = content if isinstance(content, bytes) else json.dumps(content).encode()
        return self._answer(urllib.request.Request(f"{self.address}/fit", data, {"Content-Type": kind}))

    def _answer(self, request: urllib.request.Request) -> tuple[int, Any]:
        try:
            with urllib.request.urlopen(request, timeout=600) as response:
                return response.status, _read(response.read())
        except urllib.error.HTTPError as error:
            with error:
                return error.code, _read(error.read())

    def workers(self) -> list[int]:
        """Process ids of the workers, which are forked from a child of the service."""
        return [pid for server in _children(self.process.pid) for pid in _children(server)]

    def until_warm(self) -> None:
        """Waits until a worker has fitted something."""
        while self.get("/health")[1]["status"] == "starting":
            time.sleep(0.05)


def _read(data: bytes) -> Any:
    try:
        return json.loads(data)
    except ValueError:
        return data.decode(errors="replace")


def _scratch(pid: int) -> Path:
    """The folder that a service holds open."""
    held = [Path(os.readlink(each)) for each in Path(f"/proc/{pid}/fd").iterdir()]
    (folder,) = (path for path in held if path.name.startswith(PREFIX))
    return folder


def _children(parent: int) -> list[int]:
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:  # it has ended
                continue
            if int(fields[1]) == parent and fields[0] != "Z":
                found.append(int(entry.name))
    return found


def resident_bytes(pid: int) -> int:
    """Memory of a process that is in use now, but for what it shares."""
    resident, shared = (Path("/proc") / str(pid) / "statm").read_text().split()[1:3]
    return (int(resident) - int(shared)) * os.sysconf("SC_PAGE_SIZE")


@contextmanager
def running(*arguments: str, environment: dict[str, str] | None = None) -> Iterator[Running]:
    """The command ``warp-cloth serve`` with these arguments, on a free port."""
    command = [sys.executable, "-m", "warp_cloth", "serve", *arguments, "--port", "0"]
    env = {**os.environ, **(environment or {})}
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=env)
    try:
        line = process.stdout.readline()
        assert line.startswith("serving "), line
        yield Running(line.partition(" on ")[2].partition(";")[0], process, _scratch(process.pid))
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(30)
        finally:
            process.kill()


def digests(answer: dict[str, Any]) -> dict[str, str]:
    """The hash of the worn points of each size."""
    return {each["size"]: each["digest"] for each in answer["sizes"]}


def cheap_request(radius: float, sizes: Sequence[str] | None = None, **more: Any) -> dict[str, Any]:
    """A request for the cheap product on a ball."""
    content = {"product": "cloth", "body": {"mesh": mesh_file(ball(radius))}, **more}
    return content if sizes is None else {**content, "sizes": list(sizes)}
