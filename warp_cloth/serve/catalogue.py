"""The products of a service: what can be asked for by name, read and checked before it starts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import read_toml
from warp_cloth.batch.jobs import read_products
from warp_cloth.material.fabric import shipped_fabrics
from warp_cloth.scene import TshirtShape, load_scene
from warp_cloth.scene.messages import nearest
from warp_cloth.scene.paths import file_stem
from warp_cloth.scene.shapes import SIZES

ONE_SIZE = "one size"  # what the size of a garment without sizes is called


@dataclass(frozen=True)
class Offer:
    """A product in one size: the scene, and the changes to it, that ``warp_cloth.fit`` takes."""

    scene: str
    changes: tuple[str, ...]
    garment_keys: tuple[str, ...]  # of its garments
    friction: float  # of cloth on the body


@dataclass(frozen=True)
class OfferedProduct:
    """A product: its sizes, from small to large, and its fabrics: by name what ``garment.fabric`` takes."""

    name: str
    sizes: dict[str, Offer]
    fabrics: dict[str, str]


def read_catalogue(sources: Sequence[str]) -> dict[str, OfferedProduct]:
    """The products of shipped scenes, scene files, and job files with a [product]; by name.

    Raises:
        InputError: one cannot be used, or two have the same name.
    """
    found: dict[str, OfferedProduct] = {}
    for source in sources:
        for product in _products(source):
            if product.name in found:
                raise InputError(source, f'there is a product "{product.name}" already', "give each a name of its own")
            found[product.name] = product
    if not found:
        raise InputError("products", "there are none to serve", "name a scene, or a job file with a [product]")
    return found


def product_named(catalogue: dict[str, OfferedProduct], name: str) -> OfferedProduct:
    """The product of this name; InputError where there is none."""
    if name not in catalogue:
        hint = nearest(name, catalogue)
        raise InputError("product", f'there is no product "{name}"', hint or f"choose from {', '.join(catalogue)}")
    return catalogue[name]


def _products(source: str) -> list[OfferedProduct]:
    path = Path(source)
    shipped = {name: name for name in shipped_fabrics()}
    if path.suffix.lower() == ".toml" and "product" in read_toml(path, "scene or job file"):
        garments, fabrics = read_products(path)
        named = {file_stem(Path(fabric)): fabric for fabric in fabrics} or shipped
        return [
            OfferedProduct(
                name,
                {size or ONE_SIZE: _offer(item.scene, item.changes) for size, item in sizes.items()},
                named,
            )
            for name, sizes in garments.items()
        ]
    scene = load_scene(source)
    first = scene.garment_keys[0]
    is_sized = isinstance(scene.garments[0].shape, TshirtShape)
    changes = {size: (f"{first}.shape.size={size}",) for size in SIZES} if is_sized else {ONE_SIZE: ()}
    named_source = str(path.absolute()) if path.is_file() else source
    return [OfferedProduct(scene.name, {size: _offer(named_source, own) for size, own in changes.items()}, shipped)]


def _offer(source: str, changes: Sequence[str]) -> Offer:
    scene = load_scene(source, changes)
    friction = 0.5 if scene.avatar is None else scene.avatar.friction
    return Offer(source, tuple(changes), scene.garment_keys, friction)
