"""From a request to an order: the scenes of its sizes, checked as far as that takes no mesh."""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import re
import shutil
from dataclasses import dataclass, field, replace
from pathlib import Path

from pydantic import ValidationError

from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import toml_text
from warp_cloth.maps.kinds import chosen_maps
from warp_cloth.material.fabric import shipped_fabrics
from warp_cloth.scene.messages import nearest, scene_error, show
from warp_cloth.scene.wearables import AvatarSpec
from warp_cloth.serve.catalogue import Offer, OfferedProduct, product_named
from warp_cloth.serve.schema import MOST_SIZES, FitRequest, MeshFile

OWN = "own garment"
SIMPLE = re.compile(r"[A-Za-z0-9-]{1,40}")  # names of sizes that a file can have, too


Stated = tuple[str, tuple[str, ...]]  # a scene (empty: none but the changes), and changes of it


@dataclass(frozen=True)
class FileBytes:
    """A mesh file of a request, which exists in the order's folder while that is worked on."""

    name: str
    data: bytes = field(repr=False)


@dataclass(frozen=True)
class Order:
    """What a worker needs to answer a request."""

    product: str
    body: str  # equal for the same body: orders for it are fitted together
    sizes: dict[str, Stated]
    files: tuple[FileBytes, ...]
    folder: Path  # of this order alone; removed once it is answered
    ease: float  # wanted [m]
    maps: tuple[str, ...]
    glb: str

    def written(self) -> Order:
        """This order with its files in its folder and no longer here: it goes to a worker in a few bytes.

        Raises:
            OSError: there is no room.
        """
        self.remove()  # what a worker has left that died
        self.folder.mkdir(mode=0o700)
        for file in self.files:
            (self.folder / file.name).write_bytes(file.data)
        return replace(self, files=())

    def remove(self) -> None:
        """Removes the folder, if it is there."""
        shutil.rmtree(self.folder, ignore_errors=True)


def parsed(raw: bytes) -> FitRequest:
    """The request in a body of JSON.

    Raises:
        InputError: it is none.
    """
    try:
        return FitRequest.model_validate_json(raw)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        if first["type"] == "json_invalid":
            raise InputError("request", f"is not JSON: {first['ctx']['error']}", "see /docs") from None
        raise scene_error(error, FitRequest, _place, many_garments=True) from None


def _place(key: str, with_key: bool) -> str:
    return f"request: {key}" if key and with_key else "request"


def order_of(request: FitRequest, catalogue: dict[str, OfferedProduct], folder: Path) -> Order:
    """The order of a request.

    Raises:
        InputError: there is no such product, size, fabric or map, or a file is not base64.
    """
    files: list[FileBytes] = []
    if request.garments is not None:
        name, offers = OWN, _own_offers(request.garments, folder, files)
        fabrics = {each: each for each in shipped_fabrics()}
    else:
        product = product_named(catalogue, request.product or "")
        name, offers, fabrics = product.name, product.sizes, product.fabrics
    chosen = _chosen_sizes(request.sizes, offers)
    fabric = None if request.fabric is None else _chosen_fabric(request.fabric, fabrics, "fabric")
    mesh_file, measures = request.body.mesh, request.body.measures
    if mesh_file is not None:
        body: dict[str, object] = {"mesh": _file(mesh_file, "body", "body.mesh", folder, files), **_stated(mesh_file)}
        same_body = hashlib.sha256(files[-1].data).hexdigest()
    else:
        body = {"measures": measures.model_dump(exclude_none=True) if measures is not None else {}}
        same_body = toml_text(body)
    sizes = {}
    for size, offer in chosen.items():
        changes = [*offer.changes, f"avatar={toml_text({**body, 'friction': offer.friction})}"]
        changes += [f"{key}.fabric={fabric}" for key in offer.garment_keys if fabric is not None]
        sizes[size] = offer.scene, tuple(changes)
    maps = chosen_maps(request.maps)
    return Order(name, same_body, sizes, tuple(files), folder, 1e-2 * request.ease_cm, maps, request.glb)


def _own_offers(garments: dict[str, MeshFile], folder: Path, files: list[FileBytes]) -> dict[str, Offer]:
    """The sizes of a garment that came with its request."""
    friction = AvatarSpec.model_fields["friction"].default
    offers: dict[str, Offer] = {}
    for number, (size, mesh) in enumerate(garments.items()):
        alike = next((each for each in offers if each.casefold() == size.casefold()), None)
        if alike is not None:  # sizes are chosen by name whatever its case, and files may be told apart likewise
            problem = f"sizes {show(alike)} and {show(size)} differ by case alone"
            raise InputError("request: garments", problem, "name them otherwise")
        # "_" is in no simple name, so the file is that of no other size, such as one that is named by a number
        stem = f"garment_{size}" if SIMPLE.fullmatch(size) else f"garment_number_{number}"
        keys = {"mesh": _file(mesh, stem, f"garments.{size}", folder, files), **_stated(mesh)}
        offers[size] = Offer("", (f"garment={toml_text(keys)}",), ("garment",), friction)
    return offers


def _stated(mesh: MeshFile) -> dict[str, str]:
    given = {"units": mesh.units, "up": mesh.up}
    return {key: value for key, value in given.items() if value is not None}


def _file(mesh: MeshFile, stem: str, key: str, folder: Path, files: list[FileBytes]) -> str:
    """The path that a mesh of a request will have."""
    try:
        data = base64.b64decode(_plain_base64(mesh.data), validate=True)
    except (binascii.Error, ValueError):
        raise InputError(f"request: {key}.data", "is not base64", "encode the file's bytes") from None
    if mesh.format == "glb" and _names_files(data):
        raise InputError(f"request: {key}.data", "names another file", "export a .glb that holds all of its data")
    files.append(FileBytes(f"{stem}.{mesh.format}", data))
    return str(folder / files[-1].name)


def _plain_base64(text: str) -> str:
    """Base64 without the lines that ``base64 FILE`` breaks it into, and without the head of a browser's data URL."""
    if text.startswith("data:"):
        text = text.partition(",")[2]
    return "".join(text.split())


def _names_files(data: bytes) -> bool:
    """Whether a .glb file refers to other files; what is no such file is left to its reader to refuse."""
    try:
        tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
        parts = [part for kind in ("buffers", "images") for part in tree.get(kind, ())]
        return any(not str(part.get("uri", "data:")).startswith("data:") for part in parts)
    except (ValueError, AttributeError, TypeError, RecursionError):
        return False


def _chosen_sizes(wanted: tuple[str, ...] | None, offers: dict[str, Offer]) -> dict[str, Offer]:
    """The sizes wanted, in the product's order."""
    known = {size.casefold(): size for size in offers}
    for size in wanted or ():
        if size.casefold() not in known:
            raise InputError("request: sizes", f"there is no size {show(size)}", f"choose from {', '.join(offers)}")
    named = set(offers) if wanted is None else {known[size.casefold()] for size in wanted}
    chosen = {size: offer for size, offer in offers.items() if size in named}
    if len(chosen) > MOST_SIZES:
        raise InputError("request: sizes", f"the product has {len(chosen)} sizes", f"name at most {MOST_SIZES}")
    return chosen


def _chosen_fabric(name: str, fabrics: dict[str, str], key: str) -> str:
    if name not in fabrics:
        hint = nearest(name, fabrics) or f"choose from {', '.join(fabrics)}"
        raise InputError(f"request: {key}", f"there is no fabric {show(name)}", hint)
    return fabrics[name]
