"""What the service stands: requests at once, bad ones, very many, and killed workers; all answers checked.

    python tests/benchmarks/serve_load.py --device cuda --only at_once
    python tests/benchmarks/serve_load.py --device cpu --cheap --requests 10000

``at_once`` sends 100 requests in the same moment, for 12 bodies and 3 sizes, and compares the worn points' hashes with
those of ``warp_cloth.fit``. ``bad`` sends 1,000 damaged requests; each must be refused in one line (or be answered,
where the damage does no harm). ``memory`` sends ``--requests`` of a cheap product, and measures what processes hold.
``kills`` kills workers at random moments; every request must be answered rightly or be refused with 503.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import statistics
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np
from measured import Figures, script_parser
from services import CHEAP, CHEAP_CHANGES, SIDES, Running, ball, cheap_request, digests, resident_bytes, running

CASES = ("at_once", "bad", "memory", "kills")
BODIES = [
    {"stature": stature, "chest": chest, "waist": round(chest - 0.12, 2), "hip": round(chest + 0.02, 2)}
    for stature in (1.64, 1.74, 1.84)
    for chest in (0.9, 0.96, 1.02, 1.08)
]
RADII = [round(0.19 + 0.01 * number, 2) for number in range(12)]  # of the cheap bodies [m]
SIZES = ("S", "M", "L")
AT_ONCE, BAD, KILLS = 100, 1000, 20
CLIENTS = 8
PERIODS = 10  # of the memory's course


def requests_of(cheap: bool) -> list[tuple[Any, str, dict[str, Any]]]:
    """Body, size and request of each combination."""
    if cheap:
        return [(radius, size, cheap_request(radius, (size,))) for radius in RADII for size in SIZES]
    return [
        (json.dumps(body), size, {"product": "tshirt", "sizes": [size], "body": {"measures": body}})
        for body in BODIES
        for size in SIZES
    ]


def alone(body: Any, size: str, cheap: bool, device: str | None, folder: Path) -> str:
    """The hash of the worn points that ``warp_cloth.fit`` gives."""
    import warp_cloth
    from warp_cloth.base.toml_file import toml_text
    from warp_cloth.batch.rows import points_digest

    if cheap:
        file = folder / f"{body}.obj"
        file.write_bytes(ball(body))
        stated: dict[str, Any] = {"mesh": str(file), "units": "m"}
        source, changes = "sphere", [*CHEAP_CHANGES, f"garment.shape.side={SIDES[size]}"]
    else:
        stated, source, changes = {"measures": json.loads(body)}, "tshirt", [f"garment.shape.size={size}"]
    fit = warp_cloth.fit(source, device=device, overrides=[*changes, f"avatar={toml_text(stated)}"])
    return points_digest([worn.points for worn in fit.garments])


def at_once(figures: Figures, service: Running, options: argparse.Namespace, folder: Path) -> None:
    combinations = requests_of(options.cheap)
    chosen = [combinations[number % len(combinations)] for number in range(AT_ONCE)]
    random.Random(0).shuffle(chosen)
    barrier = threading.Barrier(AT_ONCE)

    def send(entry: tuple[Any, str, dict[str, Any]]) -> tuple[float, int, Any]:
        barrier.wait()
        began = time.perf_counter()
        status, answer = service.post(entry[2])
        return time.perf_counter() - began, status, answer

    with ThreadPoolExecutor(AT_ONCE) as pool:
        began = time.perf_counter()
        replies = list(pool.map(send, chosen))
        wall = time.perf_counter() - began
    right = {(body, size): alone(body, size, options.cheap, options.device, folder) for body, size, _ in combinations}
    same = sum(
        status == 200 and digests(answer) == {size: right[body, size]}
        for (body, size, _), (_, status, answer) in zip(chosen, replies, strict=True)
    )
    for status, answer in [(status, answer) for _, status, answer in replies if status != 200][:3]:
        print(f"# {status} {answer}")
    waits = sorted(seconds for seconds, *_ in replies)
    figures.add("at_once.same_bits", same, "requests")
    figures.add("at_once.different_garments", len(set(right.values())), "garments")
    figures.add("at_once.p50", statistics.median(waits), "s")
    figures.add("at_once.p99", float(np.percentile(waits, 99)), "s")
    figures.add("at_once.rate", AT_ONCE / wall, "requests/s")


def damaged(rng: random.Random) -> bytes:
    """A request that is damaged somewhere: in its bytes, in its values, or in the mesh of its body."""
    request = cheap_request(0.25, ("S",))
    kind = rng.randrange(4)
    if kind == 0:
        data = bytearray(json.dumps(request).encode())
        for _ in range(rng.randrange(1, 20)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        return bytes(data[: rng.randrange(len(data))] if rng.random() < 0.5 else data)
    if kind == 1:
        wrong = [None, True, -1, 1e300, "", "x" * 5000, [], {}, [[]], {"a": 1}, "\u0000", 10**400, "NaN", ["S"] * 99]
        key = rng.choice([*request, "sizes", "fabric", "maps", "glb", "ease_cm", "extra"])
        return json.dumps({**request, key: rng.choice(wrong)}).encode()
    if kind == 2:
        lines = ball(0.25).split(b"\n")
        for _ in range(rng.randrange(1, 400)):
            line = rng.randrange(len(lines))
            lines[line] = rng.choice(
                [b"", b"v nan 0 0", b"v 1e300 0 0", b"f 1 1 1", b"f 9999999 1 2", b"f", b"\xff", b"v 0"]
            )
        mesh = {**request["body"]["mesh"], "data": _base64(b"\n".join(lines))}
        return json.dumps({**request, "body": {"mesh": mesh}}).encode()
    noise = rng.randbytes(rng.randrange(2000))
    head = {"glb": b"glTF\x02\x00\x00\x00", "ply": b"ply\nformat ascii 1.0\nelement vertex 3\n", "stl": b"", "obj": b""}
    format = rng.choice(list(head))
    return json.dumps({**request, "body": {"mesh": {"data": _base64(head[format] + noise), "format": format}}}).encode()


def _base64(data: bytes) -> str:
    import base64

    return base64.b64encode(data).decode()


def bad(figures: Figures, service: Running) -> None:
    rng = random.Random(1)
    contents = [damaged(rng) for _ in range(BAD)]
    with ThreadPoolExecutor(CLIENTS) as pool:
        replies = list(pool.map(service.post, contents))
    counts = Counter(status for status, _ in replies)
    print(f"# {dict(counts)}")
    plain = sum(
        400 <= status < 500 and isinstance(answer, dict) and "\n" not in answer.get("error", "\n")
        for status, answer in replies
    )
    figures.add("bad.refused_in_a_line", plain, "requests")
    figures.add("bad.harmless", counts[200], "requests")
    figures.add("bad.other", BAD - plain - counts[200], "requests")
    for status, answer in [reply for reply in replies if reply[0] not in (200, *range(400, 500))][:3]:
        print(f"# {status} {answer}")


def memory(figures: Figures, service: Running, count: int) -> None:
    all_of_it: dict[str, Any] = {"maps": ["gap"], "glb": "garment"}
    requests = [
        cheap_request(radius, (size,), **(all_of_it if number % 4 == 0 else {}))
        for number, radius in enumerate(RADII)
        for size in SIZES
    ]
    right = [digests(service.post(request)[1]) for request in requests]
    wrong = 0
    course: list[dict[str, float]] = []
    waits: list[float] = []

    def send(number: int) -> bool:
        began = time.perf_counter()
        status, answer = service.post(requests[number % len(requests)])
        waits.append(time.perf_counter() - began)
        return status == 200 and digests(answer) == right[number % len(requests)]

    began = time.perf_counter()
    with ThreadPoolExecutor(CLIENTS) as pool:
        for period in range(PERIODS):
            numbers = range(period * count // PERIODS, (period + 1) * count // PERIODS)
            wrong += sum(not same for same in pool.map(send, numbers))
            held = {"service": resident_bytes(service.process.pid)}
            held |= {f"worker_{n}": resident_bytes(pid) for n, pid in enumerate(sorted(service.workers()))}
            course.append({name: size / 1e6 for name, size in held.items()})
            print("# MB held:", {name: round(size, 1) for name, size in course[-1].items()}, flush=True)
    figures.add("memory.requests", count, "requests")
    figures.add("memory.wrong", wrong, "requests")
    figures.add("memory.rate", count / (time.perf_counter() - began), "requests/s")
    figures.add("memory.p50", statistics.median(waits), "s")
    figures.add("memory.p99", float(np.percentile(waits, 99)), "s")
    for name in course[0]:
        figures.add(f"memory.{name}.first_tenth", course[0][name], "MB")
        figures.add(f"memory.{name}.last_tenth", course[-1].get(name, float("nan")), "MB")


def kills(figures: Figures, service: Running) -> None:
    requests = [cheap_request(radius, (size,)) for radius in RADII for size in SIZES]
    right = [digests(service.post(request)[1]) for request in requests]
    ended, rng = threading.Event(), random.Random(2)

    def kill() -> None:
        for _ in range(KILLS):
            time.sleep(rng.uniform(0.5, 2.0))
            alive = service.workers()
            if alive:
                os.kill(rng.choice(alive), signal.SIGKILL)
        ended.set()

    outcomes: Counter[str] = Counter()

    def send(index: int) -> None:
        while not ended.is_set():
            status, answer = service.post(requests[index % len(requests)])
            same = status == 200 and digests(answer) == right[index % len(requests)]
            outcomes["right" if same else "wrong" if status == 200 else str(status)] += 1
            index += CLIENTS

    killer = threading.Thread(target=kill)
    killer.start()
    with ThreadPoolExecutor(CLIENTS) as pool:
        list(pool.map(send, range(CLIENTS)))
    killer.join()
    print(f"# {dict(outcomes)} {service.get('/health')[1]}")
    figures.add("kills.workers", KILLS, "kills")
    figures.add("kills.right", outcomes["right"], "requests")
    figures.add("kills.wrong", outcomes["wrong"], "requests")
    figures.add("kills.refused", outcomes.total() - outcomes["right"] - outcomes["wrong"], "requests")


def main() -> None:
    reader = script_parser(__doc__, device="cpu")
    reader.add_argument("--workers", type=int, help="of the service")
    reader.add_argument("--cheap", action="store_true", help="at_once, too, with the cheap product")
    reader.add_argument("--requests", type=int, default=10_000, help="of memory")
    reader.add_argument("--only", default=",".join(CASES), help="cases, separated by commas")
    options = reader.parse_args()
    cases: Sequence[str] = options.only.split(",")
    if unknown := set(cases) - set(CASES):
        reader.error(f"no such case: {', '.join(sorted(unknown))}")
    with Figures(__file__, options, device=options.device) as figures, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "catalogue.toml").write_text(CHEAP)
        words = [str(folder / "catalogue.toml"), "--device", options.device, "--queue", "256", "--timeout", "590"]
        words += ["--workers", str(options.workers)] if options.workers else []
        with running(*(words if options.cheap else ["tshirt", *words])) as service:
            service.until_warm()
            run: dict[str, Callable[[], None]] = {
                "at_once": lambda: at_once(figures, service, options, folder),
                "bad": lambda: bad(figures, service),
                "memory": lambda: memory(figures, service, options.requests),
                "kills": lambda: kills(figures, service),
            }
            for case in cases:
                run[case]()


if __name__ == "__main__":
    main()
