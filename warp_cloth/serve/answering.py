"""What a worker of the service does: fits the sizes of orders that waited together, and writes their answers."""

from __future__ import annotations

import base64
import itertools
import json
import logging
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any

from warp_cloth.base.errors import OVERRIDE, InputError, OutputError
from warp_cloth.base.warp_setup import start_warp
from warp_cloth.batch.rows import points_digest
from warp_cloth.batch.task import SMALLER, DeviceLostError, device_answers, out_of_memory
from warp_cloth.serve.orders import Order, Stated

if TYPE_CHECKING:
    from warp_cloth.batch.loading import LoadCache
    from warp_cloth.batch.sizes import SizeFit
    from warp_cloth.fitting.fit import Fit
    from warp_cloth.scene import Scene


log = logging.getLogger(__name__)


@dataclass(frozen=True)
class OrderTask:
    """Orders for a worker, to be fitted together."""

    orders: tuple[Order, ...]
    device: str
    fraction: float = 1.0  # of a GPU's memory, where other workers use it, too
    lease: Path | None = None  # file of the GPU's lease, see fit_many


@dataclass(frozen=True)
class Reply:
    """An answer, or a refusal, as it is sent."""

    status: int  # of HTTP
    content: bytes  # JSON


def refused(status: int, reason: str) -> Reply:
    """A refusal: one line."""
    return Reply(status, json.dumps({"error": " ".join(reason.split())}).encode())


def answer(task: OrderTask, load_cache: LoadCache) -> list[Reply]:
    """Fits all sizes of all orders, and returns their replies in the same order.

    What the cache holds of bodies is forgotten before it returns.

    Raises:
        DeviceLostError: the device does not respond.
    """
    import warp_cloth.batch.many  # noqa: F401 - before the clock starts

    start_warp()
    if not device_answers(task.device):
        raise DeviceLostError(f"{task.device} does not respond")
    try:
        return _answered(task, load_cache)
    except DeviceLostError:
        raise
    except Exception as error:
        log.exception("requests cannot be answered")
        return [_failure(error, task.device)] * len(task.orders)


def _answered(task: OrderTask, load_cache: LoadCache) -> list[Reply]:
    began = time.perf_counter()
    known = set(load_cache.mesh_cache.portable_entries())
    loaded: dict[Stated, Scene | str] = {}
    scenes = [_scenes(order, loaded) for order in task.orders]
    usable = [scene for scene in loaded.values() if not isinstance(scene, str)]
    try:
        fits = dict(zip(map(id, usable), _fitted(task, usable, load_cache), strict=True))
        replies = []
        for order, own in zip(task.orders, scenes, strict=True):
            found = {size: scene if isinstance(scene, str) else fits[id(scene)] for size, scene in own.items()}
            replies.append(_reply(order, found, task.device, time.perf_counter() - began))
        return replies
    finally:
        _forget_bodies(load_cache, known, usable)


def _scenes(order: Order, loaded: dict[Stated, Scene | str]) -> dict[str, Scene | str]:
    """The scene of each size, or why it cannot be used; one for all orders that state the same."""
    for stated in order.sizes.values():
        if stated not in loaded:
            loaded[stated] = _scene(stated, order)
    return {size: loaded[stated] for size, stated in order.sizes.items()}


def _scene(stated: Stated, order: Order) -> Scene | str:
    from warp_cloth.scene import load_scene

    source, changes = stated
    try:
        return load_scene(source or {}, changes)
    except InputError as error:
        return _words(error, order)


def _fitted(task: OrderTask, scenes: Sequence[Scene], load_cache: LoadCache) -> list[Fit | Exception]:
    from warp_cloth.batch.many import fit_many
    from warp_cloth.batch.memory import available_bytes

    names = tuple(dict.fromkeys(itertools.chain.from_iterable(order.maps for order in task.orders)))
    budget = available_bytes(task.device, task.fraction)
    return fit_many(scenes, task.device, budget=budget, maps=names, load_cache=load_cache, lease=task.lease)


def _forget_bodies(load_cache: LoadCache, known: set[Any], scenes: Sequence[Scene]) -> None:
    """Empties the cache but for what was ``known`` before, and garments from files that say nothing of a body."""
    from warp_cloth.base.cache import Cache
    from warp_cloth.garment.outfit import MeshCache, garment_keys, generated_body

    kept = set(known)
    for scene in scenes:
        own = scene.directory == Path()  # came with its request
        for index, spec in enumerate(scene.garments):
            if not own and spec.file is not None and not generated_body(scene):
                mesh, geometry, rest = garment_keys(scene, index)
                kept |= {mesh, geometry, rest, ("garment", *rest)}
    entries = load_cache.mesh_cache.subset(kept)
    load_cache.mesh_cache, load_cache.cache = MeshCache(), Cache()
    load_cache.mesh_cache.add_entries(entries)


def _reply(order: Order, found: Mapping[str, Fit | Exception | str], device: str, seconds: float) -> Reply:
    """The answer to one order, or a refusal where none of its sizes could be fitted."""
    from warp_cloth.batch.sizes import measured_size, recommendation, unusable_size

    try:
        fits: list[tuple[SizeFit, Fit | None]] = []
        for size, fit in found.items():
            if isinstance(fit, str):
                fits.append((unusable_size(size, fit), None))
            elif isinstance(fit, InputError) and not isinstance(fit, OutputError):
                fits.append((unusable_size(size, _words(fit, order)), None))
            elif isinstance(fit, Exception):
                raise fit
            else:
                fits.append((measured_size(size, fit), fit))
        if all(fit is None for _, fit in fits):
            return refused(HTTPStatus.UNPROCESSABLE_ENTITY, fits[0][0].message)
        recommended, reason = recommendation([size for size, _ in fits], order.ease)
        content = {
            "product": order.product,
            "recommended": recommended,
            "reason": reason,
            "sizes": [_size_json(order, size, fit) for size, fit in fits],
            "seconds": round(seconds, 3),
        }
        return Reply(HTTPStatus.OK, json.dumps(content, allow_nan=False).encode())
    except InputError as error:
        return refused(HTTPStatus.UNPROCESSABLE_ENTITY, _words(error, order))
    except Exception as error:
        return _failure(error, device)


def _failure(error: Exception, device: str) -> Reply:
    """A refusal that is not the request's fault; DeviceLostError where nothing else can be fitted here either."""
    if out_of_memory(error):
        return refused(HTTPStatus.SERVICE_UNAVAILABLE, f"out of memory on {device}; {SMALLER}")
    if not device_answers(device):
        raise DeviceLostError(f"{device} stopped responding: {error}") from error
    reason = f"the fit failed ({type(error).__name__}); tell those who run this service"
    return refused(HTTPStatus.INTERNAL_SERVER_ERROR, reason)


def _size_json(order: Order, size: SizeFit, fit: Fit | None) -> dict[str, Any]:
    """The schema's SizeAnswer."""
    from warp_cloth.report.shown import NOT_WORN, shown_verdict

    report = {} if fit is None else fit.report
    return {
        "size": size.size,
        "status": size.status,
        "worn": fit is not None and fit.worn,
        "verdict": (NOT_WORN if fit is None else shown_verdict(report)).words,
        "message": size.message,
        "problems": [
            {"code": each.code.value, "message": each.message, "remedy": each.remedy, "note": each.code.is_note}
            for each in (() if fit is None else fit.problems)
        ],
        "ease_cm": {level: round(100 * found.ease, 3) for level, found in size.levels.items()},
        "strain_p99": _finite(size.strain_p99),
        "rest_error_mm": _finite(report.get("rest_error_mm")),
        "iterations": report.get("iterations"),
        "digest": None if fit is None else points_digest([worn.points for worn in fit.garments]),
        "maps": {} if fit is None else _maps_json(order, fit),
        "glb": None if fit is None or order.glb == "none" else _glb(order, fit),
    }


def _maps_json(order: Order, fit: Fit) -> dict[str, Any]:
    found = {}
    for name in order.maps:
        if name in fit.map_ranges:
            values = {worn.name: worn.fields[name] for worn in fit.garments if name in worn.fields}
            texts = {garment: _base64(each.astype("<f4").tobytes()) for garment, each in values.items()}
            found[name] = {**fit.report["maps"][name], "values": texts}
    return found


def _glb(order: Order, fit: Fit) -> str | None:
    """The worn meshes as a .glb file in base64; None where their shape is not finite."""
    import numpy as np

    from warp_cloth.export.meshes import write_glb

    if not all(np.isfinite(worn.points).all() for worn in fit.garments):
        return None
    path = order.folder / "worn.glb"
    colour = next((name for name in order.maps if name in fit.map_ranges), "")
    avatar = fit.avatar if order.glb == "worn" else None
    write_glb(path, garments=fit.garments, avatar=avatar, ranges=fit.map_ranges, colour=colour)
    return _base64(path.read_bytes())


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode("ascii")


def _finite(value: Any) -> float | None:
    return float(value) if value is not None and abs(float(value)) < float("inf") else None


def _words(error: InputError, order: Order) -> str:
    """The error without the name of the order's folder."""
    place = error.place.partition("=")[0] if error.place.startswith(OVERRIDE) else error.place
    sentence = str(InputError(place.removeprefix(OVERRIDE), error.problem, error.remedy))
    return sentence.replace(f"{order.folder}/", "")
