"""A fitter that stays: one garment and one body, fitted again in other fabrics, sizes and settings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from warp_cloth.base.device import device_named
from warp_cloth.base.errors import InputError
from warp_cloth.base.threads import LAUNCH_LOCK
from warp_cloth.fitting.fit import Caches, Fit, Progress, fit_loaded
from warp_cloth.scene import Scene, load_scene
from warp_cloth.scene.held_mesh import Held, in_file
from warp_cloth.scene.overrides import overrides_of


class Fitter:
    """Fits one scene again and again; what does not change is kept from answer to answer.

    Every answer has the same bits as ``warp_cloth.fit`` of the same scene. Calls from several threads run one after
    another. Files that change are read again. Answers share meshes with the fitter: do not change those in place.

    >>> fitter = warp_cloth.Fitter("shirt.obj", "body.obj")
    >>> jersey = fitter.fit(fabric="jersey")
    >>> denim = fitter.fit(fabric="denim", start=jersey)
    """

    def __init__(
        self,
        garment: str | Path | Mapping[str, Any] | Held,
        avatar: str | Path | Held | None = None,
        *,
        device: str | None = None,
        overrides: Sequence[str] | Mapping[str, Any] = (),
    ) -> None:
        """Reads and checks the scene; the first answer loads its meshes.

        Args:
            garment: what ``warp_cloth.fit`` takes as a scene, not loaded yet; with ``avatar``, a garment's mesh.
            avatar: the body's mesh, or "mannequin".
            device: "cpu", "cuda" or "cuda:N"; None: a GPU if there is one.
            overrides: changes to the scene, for all answers.

        Raises:
            InputError: there is no such device, or the scene cannot be used.
        """
        if isinstance(garment, Scene):
            raise InputError("garment", "is a loaded scene, which cannot be changed", "give what it was loaded from")
        self._given = overrides_of(overrides)
        self._load = partial(load_scene, in_file(garment, "garment", "garment"))
        self._avatar = in_file(avatar, "avatar", "body")
        self._load(self._given, on=self._avatar)
        self.device = device_named(device)
        self._caches = Caches.limited()

    def fit(
        self,
        *,
        fabric: Any = None,
        size: str | None = None,
        offset_mm: float | None = None,
        avatar: str | Path | Held | None = None,
        avatar_shape: Mapping[str, Any] | None = None,
        overrides: Sequence[str] | Mapping[str, Any] = (),
        frames: int = 0,
        maps: str | Sequence[str] = (),
        start: Fit | str | Path | None = None,
        progress: Callable[[Progress], None] | None = None,
    ) -> Fit:
        """Fits the scene with these changes, which hold for this answer alone; the rest as for ``warp_cloth.fit``.

        Args:
            fabric: of the garment: a shipped name, a .toml file, a table or a ``Fabric`` (``garment.fabric``).
            size: of a generated garment (``garment.shape.size``).
            offset_mm: gap between skin and cloth (``collision.offset_mm``).
            avatar: another body: its mesh, or "mannequin".
            avatar_shape: measures of a generated body, {"chest": 1.02} (``avatar.shape``); others stay.
            overrides: other changes.
            frames: number of intermediate shapes to keep.
            maps: fit maps to compute.
            start: an earlier result, or its file, whose worn shape the garments start from.
            progress: called with a ``Progress`` at every stage and check.

        Raises:
            InputError: a change is not valid; the fitter stays as it was.
        """
        named = {
            "garment.fabric": fabric,
            "garment.shape.size": size,
            "collision.offset_mm": offset_mm,
            "avatar.shape": avatar_shape,
        }
        changes = overrides_of({key: value for key, value in named.items() if value is not None})
        on = self._avatar if avatar is None else in_file(avatar, "avatar", "body")
        load = partial(self._load, [*self._given, *changes, *overrides_of(overrides)], on=on)
        with LAUNCH_LOCK:
            self._caches = self._caches.within_limits()
            return fit_loaded(load, self.device, self._caches, frames=frames, maps=maps, start=start, progress=progress)
