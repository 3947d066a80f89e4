"""The project's pages: their code blocks, links and headings, and small stand-ins for the files that they name."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

import numpy as np
from stages import add_mesh, add_physics, cloth_points, local

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = (".github", "scenes", "warp_cloth", "kernels", "tests")
PAGES = (ROOT / "README.md", *sorted(page for folder in FOLDERS for page in (ROOT / folder).rglob("*.md")))

_FENCE = re.compile(
    r"(?:^ *<!-- test: (?P<marks>[^\n]*?) -->\n\n?)?^(?P<indent> *)```(?P<language>\w+)\n(?P<text>.*?)^(?P=indent)```$",
    re.MULTILINE | re.DOTALL,
)
_ANY_FENCE = re.compile(r"^( *)```.*?^\1```$", re.MULTILINE | re.DOTALL)
_HERE_DOCUMENT = re.compile(r"<<'(\w+)'\n.*?^\1$", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"`([^`\n]+)`")
_LINK = re.compile(r"\]\(([^()\s]+)\)")
_HEADING = re.compile(r"^#+ +(.*?) *$", re.MULTILINE)

# tests/README.md lists them
MARKS = frozenset({"long", "needs", "files", "file", "in", "serves", "form", "fragment", "ends", "as"})


@dataclass(frozen=True)
class Block:
    """A fenced block of a page, with what the comment above it says on how it is tested."""

    page: Path
    line: int
    language: str
    text: str
    marks: dict[str, tuple[str, ...]]

    @property
    def place(self) -> str:
        return f"{self.page.relative_to(ROOT)}:{self.line}"


def blocks(page: Path) -> list[Block]:
    """The fenced blocks of a page, in order."""
    content = page.read_text(encoding="utf-8")
    found = []
    for match in _FENCE.finditer(content):
        marks = {}
        for mark in filter(None, (part.split() for part in (match["marks"] or "").split(";"))):
            marks[mark[0]] = tuple(mark[1:])
        line = content.count("\n", 0, match.start("text")) + 1
        found.append(Block(page, line, match["language"], dedent(match["text"]), marks))
    return found


def prose(page: Path) -> str:
    """A page without its fenced blocks."""
    return _ANY_FENCE.sub("", page.read_text(encoding="utf-8"))


def inline_code(page: Path) -> list[str]:
    return _CODE.findall(prose(page))


def links(page: Path) -> list[str]:
    """Targets of the links and pictures of a page that lie in the project."""
    targets = _LINK.findall(_CODE.sub("", prose(page)))
    return [target for target in targets if not re.match(r"[a-z]+:", target)]


def anchors(page: Path) -> set[str]:
    """What links may name after #: GitHub's, lower case, spaces as hyphens, without punctuation."""
    names: set[str] = set()
    for heading in _HEADING.findall(prose(page)):
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        name = base = re.sub(r"[^\w\- ]", "", text).replace(" ", "-")
        number = 0
        while name in names:
            number += 1
            name = f"{base}-{number}"
        names.add(name)
    return names


def commands(text: str) -> Iterator[list[str]]:
    """The simple commands of shell text as words, without variables set before them and folders of programs."""
    for line in _HERE_DOCUMENT.sub("", text).replace("\\\n", " ").splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars=True)
        lexer.whitespace_split = True
        command: list[str] = []
        for word in [*lexer, ";"]:
            if word and set(word) <= set("();<>|&"):
                if command:
                    yield [Path(command[0]).name, *command[1:]]
                command = []
            elif command or not re.match(r"[A-Z_]+=", word):
                command.append(word)


def write_stand_in(path: Path) -> None:
    """A small file of the kind that its name says: body.obj, body_pose.obj, shirt_S.obj, scene.toml, results.csv."""
    kind, _, size = path.stem.partition("_")
    path.parent.mkdir(exist_ok=True)
    if kind == "scene":
        path.write_text('[garment]\nmesh = "shirt_M.obj"\nrest = "uv"\n\n[avatar]\nmesh = "body.obj"\n')
        for name in ("shirt_M.obj", "body.obj"):
            write_stand_in(path.with_name(name))
    elif kind == "stage":
        _write_stage(path)
    elif kind == "results":
        rows = ("shirt-1,true,jersey,3.0,0.08", "shirt-2,true,jersey,5.0,0.05", "shirt-3,false,denim,1.0,0.2")
        path.write_text("\n".join(["name,worn,garment.fabric,ease_chest_cm,strain_p99", *rows, ""]))
    elif kind in ("shirt", "tshirt", "jacket", "dress", "skirt"):
        _write_garment(path, size if size in ("S", "M", "L") else "M")
    else:
        _write_body(path, moved=0.02 if size else 0.0)


def _write_garment(path: Path, size: str) -> None:
    """A coarse T-shirt round the body of size M, its panels in the texture coordinates."""
    from warp_cloth.export.meshes import write_obj
    from warp_cloth.model.result import WornGarment
    from warp_cloth.shapes import SIZE_BODIES, tshirt

    mesh = tshirt(size=size, edge=0.03, body=SIZE_BODIES["M"])
    write_obj(path, garments=[WornGarment(name=path.stem, mesh=mesh, points=mesh.points, thickness=0.0)])


def _write_body(path: Path, moved: float) -> None:
    """The body of size M; ``moved`` forward [m], which is another pose."""
    import trimesh

    from warp_cloth.shapes import SIZE_BODIES, mannequin

    body = mannequin(SIZE_BODIES["M"])
    trimesh.Trimesh(body.points + np.array([0.0, 0.0, moved]), body.triangles, process=False).export(path)


def _write_stage(path: Path) -> None:
    """A cloth, /World/shirt, with the physics schema, over a ball, /World/body."""
    from cloths import grid
    from pxr import Usd, UsdGeom

    from warp_cloth.shapes import sphere

    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    points = cloth_points()
    count = round(np.sqrt(len(points)))
    ball = sphere(radius=0.15, centre=(0.0, 0.45, 0.0), edge=0.02)
    shirt = add_mesh(stage, "/World/shirt", local(points, 1.0, False), grid(count, 0.5).triangles)
    add_physics(stage, shirt, 1.0, False)
    add_mesh(stage, "/World/body", local(ball.points, 1.0, False), ball.triangles)
    stage.Save()
