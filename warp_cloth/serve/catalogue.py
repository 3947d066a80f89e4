"""The products of a service: what can be asked for by name, read and checked before it starts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from warp_cloth.base.errors import OVERRIDE, InputError
from warp_cloth.base.toml_file import read_toml, toml_text
from warp_cloth.batch.jobs import Item, read_products
from warp_cloth.batch.sizes import graded_sizes
from warp_cloth.loading.load import content
from warp_cloth.material.fabric import shipped_fabrics
from warp_cloth.scene import Scene, TshirtShape, load_scene
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
        named = {file_stem(Path(fabric)): fabric for fabric in fabrics}
        return [
            OfferedProduct(name, _offers(source, sizes, named), named or shipped) for name, sizes in garments.items()
        ]
    scene = load_scene(source)
    own = {"": Item(scene.name, str(path.absolute()) if path.is_file() else source)}
    if isinstance(scene.garments[0].shape, TshirtShape):
        own = {size: _changed(own[""], f"{scene.garment_keys[0]}.shape.size={size}") for size in SIZES}
    return [OfferedProduct(scene.name, _offers(source, own, {}), shipped)]


def _offers(place: str, sizes: Mapping[str, Item], fabrics: Mapping[str, str]) -> dict[str, Offer]:
    """The sizes of a product, and those of its DXF pattern where it states none; its fabrics are checked, too.

    ``place`` is what was named as the product.
    """
    first = next(iter(sizes.values()))
    scene = _scene(place, first)
    key = scene.garment_keys[0]
    for fabric in fabrics.values():
        _scene(place, _changed(first, f"{key}.fabric={fabric}"))
    graded = graded_sizes(scene) if set(sizes) == {""} and scene.garments[0].size is None else ()
    found = {size: _changed(first, f"{key}.size={toml_text(size)}") for size in graded} or sizes
    return {size or ONE_SIZE: _offer(place, item) for size, item in found.items()}


def _changed(item: Item, change: str) -> Item:
    return replace(item, changes=(*item.changes, change))


def _offer(place: str, item: Item) -> Offer:
    scene = _scene(place, item)
    for spec in scene.garments:
        if spec.file is not None:
            content(spec.file, "mesh" if spec.pattern is None else "pattern")
    friction = 0.5 if scene.avatar is None else scene.avatar.friction
    return Offer(item.scene, item.changes, scene.garment_keys, friction)


def _scene(place: str, item: Item) -> Scene:
    """The scene of an item; a wrong value is named by its key in the file."""
    try:
        return load_scene(item.source, item.changes)
    except InputError as error:
        if not error.place.startswith(OVERRIDE):
            raise
        key = error.place.removeprefix(OVERRIDE).partition("=")[0]
        raise InputError(f"{place}: {key}", error.problem, error.remedy) from None
