"""Size runs: fits all sizes of a garment on one body, compares ease and strain, and recommends one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

from warp_cloth.base import arguments
from warp_cloth.base.errors import InputError
from warp_cloth.base.toml_file import toml_text
from warp_cloth.batch.contact_sheet import NO_RESULT, Card, thumbnail, write_cards
from warp_cloth.batch.jobs import PLAIN_NAME
from warp_cloth.fitting.fit import Caches, Fit, fit_loaded
from warp_cloth.maps import chosen_maps
from warp_cloth.maps.measure import add_girths
from warp_cloth.model.fit_problem import ProblemCode
from warp_cloth.model.result import Status
from warp_cloth.pattern import read_drafted
from warp_cloth.report.shown import ShownVerdict, ease_lines, shown_verdict
from warp_cloth.scene import GarmentSpec, Scene, TshirtShape, load_scene
from warp_cloth.scene.paths import file_stem
from warp_cloth.scene.shapes import SIZES

SIZE = "{size}"  # stands for the size in a change, as in garment.mesh=shirt_{size}.obj
# Ease of a loose garment at its tightest level [m]: pattern books give 4 to 10 cm for shirts.
DEFAULT_EASE = 0.04
# Strain (99th percentile) above which a size is too tight somewhere, whatever its girths. A choice: at 10 % the stiffer
# shipped fabrics pull with more than the 490 N/m at which a laboratory's tensile test ends.
MOST_STRETCH = 0.10
UNHELD = (ProblemCode.UNSUPPORTED, ProblemCode.FELL_OFF, ProblemCode.SLID_OFF, ProblemCode.DETACHED_PIECE)


@dataclass(frozen=True)
class LevelFit:
    """Body and garment at one level."""

    height: float  # above the floor [m]
    body: float  # girth of the trunk by tape [m]
    garment: float  # girth of the garment as cut [m]
    stretch: float  # of the garment as worn against as cut

    @property
    def ease(self) -> float:
        """How much larger the garment is cut than the body [m]; negative where it must stretch."""
        return self.garment - self.body


@dataclass(frozen=True, eq=False)
class SizeFit:
    """One size on the body."""

    size: str
    status: str
    message: str
    levels: Mapping[str, LevelFit]  # of chest, waist and hip those where the garment encloses the trunk
    strain_p50: float | None
    strain_p99: float | None
    fit: Fit | None
    held: bool = True  # false: it falls, or slides down to the feet
    worn: bool = True

    @property
    def ease(self) -> float | None:
        """The least ease of all levels [m]."""
        return min((level.ease for level in self.levels.values()), default=None)

    @property
    def figures(self) -> str:
        """Ease at each level, or that it is not reached, and strain, in a line."""
        levels = ease_lines(self.fit.report) if self.fit is not None and self.levels else []
        strain = self.message
        if self.strain_p99 is not None:
            strain = f"strain {100 * self.strain_p99:.1f} % (99th percentile)"
        return ", ".join([*levels, strain, *([] if self.held else ["slides down"])])

    @property
    def verdict(self) -> ShownVerdict:
        """Whether it is worn, in words."""
        return NO_RESULT if self.fit is None else shown_verdict(self.fit.report)

    def card(self) -> Card:
        """The size as a card of a page."""
        if self.fit is None:
            return Card(self.size, self.verdict.words, self.verdict.colour, "", self.message, "")
        verdict = self.verdict
        picture, page = (
            thumbnail(self.fit.garments, self.fit.avatar, self.fit.facing),
            f"{quote(self.size)}/report.html",
        )
        return Card(self.size, verdict.words, verdict.colour, f"ease: {self.figures}", self.message, picture, page)


@dataclass(frozen=True, eq=False)
class SizeRun:
    """All sizes on one body."""

    name: str
    wanted_ease: float  # [m]
    sizes: tuple[SizeFit, ...]
    recommended: str | None
    reason: str

    @property
    def advice(self) -> str:
        """What to take and why, in a sentence."""
        return f"take {self.recommended}: {self.reason}" if self.recommended else self.reason

    def report(self) -> dict[str, Any]:
        """The contents of sizes.json; lengths in centimetres where the names say so."""
        return {
            "recommended": self.recommended,
            "reason": self.reason,
            "wanted_ease_cm": 100.0 * self.wanted_ease,
            "sizes": [
                {
                    "size": each.size,
                    "status": each.status,
                    "message": each.message,
                    "held": each.held,
                    "levels": {
                        name: {
                            "height_cm": 100.0 * level.height,
                            "body_cm": 100.0 * level.body,
                            "garment_cm": 100.0 * level.garment,
                            "ease_cm": 100.0 * level.ease,
                            "stretch": level.stretch,
                        }
                        for name, level in each.levels.items()
                    },
                    "strain_p50": each.strain_p50,
                    "strain_p99": each.strain_p99,
                    "report": {k: each.fit.report[k] for k in ("residual", "rest_error_mm")} if each.fit else None,
                }
                for each in self.sizes
            ],
        }

    def save(self, directory: str | Path, *, made: Mapping[str, str] | None = None) -> list[Path]:
        """Writes a folder for each size, as ``Fit.save`` does, a picture and a page of all, then sizes.json.

        Args:
            directory: where to write; created if it is missing.
            made: for the reports: the command and the date.

        Raises:
            InputError: the folder cannot be written.
        """
        from warp_cloth.export.preview import save_picture
        from warp_cloth.export.report import check_writable, write_report
        from warp_cloth.export.size_picture import size_picture

        folder = Path(directory)
        check_writable(folder, self.name)
        (folder / "sizes.json").unlink(missing_ok=True)  # an earlier run's: this one's sizes are written first
        fits = {each.size: each.fit for each in self.sizes if each.fit is not None}
        for size, fit in fits.items():
            if made is not None:
                fit.report["made"] = dict(made)
            fit.save(folder / size)
        title = f"{self.name}: {self.advice}"
        write_cards(folder / "sizes.html", title, [each.card() for each in self.sizes])
        paths = [folder / "sizes.html", folder / "sizes.json", *(folder / size for size in fits)]
        if fits:
            save_picture(size_picture(title, fits, self.recommended), folder / "sizes.png")
            paths.insert(1, folder / "sizes.png")
        write_report(folder / "sizes.json", self.report())
        return paths


def fit_sizes(
    scene: str | Path | Mapping[str, Any],
    sizes: Sequence[str] = (),
    *,
    on: str | Path | None = None,
    fabric: Any = None,
    overrides: Sequence[str] = (),
    ease: float = DEFAULT_EASE,
    maps: str | Sequence[str] = (),
    device: str | None = None,
    progress: Callable[[str], None] | None = None,
) -> SizeRun:
    """Fits all sizes of a scene's garment on its avatar, and recommends the smallest that leaves ``ease`` everywhere.

    Args:
        scene: what ``load_scene`` takes; its avatar is the body, the same for all sizes. ``{size}`` in its name, with
            ``on``, stands for the size, as in shirt_{size}.obj.
        sizes: from small to large; empty: those of the generated T-shirt, or of the DXF pattern.
        on: the body's mesh file, or "mannequin", in place of the scene's avatar.
        fabric: of all garments.
        overrides: ``KEY=VALUE`` changes; ``{size}`` in one, or in the scene's garment.mesh or pattern, stands for it.
            Where neither has it the size is that of the generated T-shirt, or of the DXF pattern.
        ease: wanted at chest, waist and hip [m]; negative for a garment that should stretch.
        maps: fit maps to compute of each size, such as "gap", for ``warp-cloth compare``.
        device: "cpu", "cuda" or "cuda:N"; None: a GPU if there is one.
        progress: called with each size before it is fitted.

    Raises:
        InputError: the scene cannot be used in one of the sizes, or nothing in it depends on the size.
    """
    changes, sizes, ease = (
        arguments.strings(overrides, "overrides"),
        arguments.strings(sizes, "sizes"),
        arguments.number(ease, "ease"),
    )
    map_names = chosen_maps(maps)
    for size in sizes:
        if not PLAIN_NAME.fullmatch(size):
            remedy = f"use no slashes; folders go before it: override garment.mesh=FOLDER/{SIZE}.obj"
            raise InputError("sizes", f'"{size}" names a folder, and cannot be part of a file name', remedy)
    chosen = _sized_scenes(scene, sizes, changes, on, fabric)  # all are read first: a mistyped size costs no fit
    found, faults, caches = [], [], Caches()
    for size, sized_scene in chosen.items():
        if progress is not None:
            progress(size)
        try:
            found.append(_fit_size(size, sized_scene, map_names, device, caches))
        except InputError as error:
            faults.append(error)
            found.append(unusable_size(size, str(error)))
    if len(faults) == len(found) and len({str(fault) for fault in faults}) == 1:
        raise faults[0]  # of the body, or of all sizes
    recommended, reason = recommendation(found, ease)
    return SizeRun(_name(scene, chosen), ease, tuple(found), recommended, reason)


def _name(scene: Any, chosen: Mapping[str, Scene]) -> str:
    """The scene's name, without the size."""
    if _names_size(scene):
        return file_stem(Path(str(scene).replace(SIZE, ""))).strip("_- ") or "sizes"
    return next(iter(chosen.values())).name


def _names_size(scene: Any) -> bool:
    return isinstance(scene, str | Path) and SIZE in str(scene)


def _sized_scenes(scene: Any, sizes: Sequence[str], changes: Sequence[str], on: Any, fabric: Any) -> dict[str, Scene]:
    """The scene in every size."""

    def load(size: str, changes: Sequence[str]) -> Scene:
        named = str(scene).replace(SIZE, size) if _names_size(scene) else scene
        return load_scene(named, [change.replace(SIZE, size) for change in changes], on=on, fabric=fabric)

    sized = _names_size(scene) or any(SIZE in change for change in changes)
    _check_named(sizes, sized)
    base = load(sizes[0] if sizes else "", changes)
    if base.avatar is None:
        raise InputError("sizes", "the scene has no avatar to choose a size for", "add an [avatar]")
    files = [
        f"{key}.{'mesh' if spec.pattern is None else 'pattern'}={toml_text(str(spec.file.absolute()))}"
        for key, spec in zip(base.garment_keys, base.garments, strict=True)
        if spec.file is not None and SIZE in str(spec.file)
    ]
    _check_named(sizes, bool(files))
    if files:
        return {size: load(size, [*changes, *files]) for size in sizes}
    if sized:
        return {sizes[0]: base, **{size: load(size, changes) for size in sizes[1:]}}
    first = "garment" if len(base.garments) == 1 else "garment[0]"
    if graded := graded_sizes(base):
        return {size: load(size, [*changes, f"{first}.size={toml_text(size)}"]) for size in sizes or graded}
    if not isinstance(base.garments[0].shape, TshirtShape):
        raise _one_size(first, base.garments[0])
    names = [size.upper() for size in sizes] or SIZES
    unknown = next((size for size in names if size not in SIZES), None)
    if unknown is not None:
        raise InputError("sizes", f'"{unknown}" is no size of the T-shirt', f"use {', '.join(SIZES)}")
    return {size: load(size, [*changes, f"{first}.shape.size={size}"]) for size in names}


def _one_size(key: str, garment: GarmentSpec) -> InputError:
    """The error for a garment that no size changes, with the names that files of several would have."""
    stem, suffix = (garment.file.stem, garment.file.suffix) if garment.file is not None else ("garment", ".obj")
    source = "mesh" if garment.pattern is None else "pattern"
    remedy = f"name a file for each size: override {key}.{source}={stem}_{SIZE}{suffix} --size S,M,L"
    return InputError("sizes", "the garment comes in one size", remedy)


def _check_named(sizes: Sequence[str], depends: bool) -> None:
    """Refuses a scene whose files depend on the size where no sizes are named."""
    if depends and not sizes:
        raise InputError("sizes", "no sizes are named", "give them from small to large: --size S,M,L")


def graded_sizes(scene: Scene) -> tuple[str, ...]:
    """The sizes of the first garment's pattern, from small to large; none where it states none."""
    spec = scene.garments[0]
    if spec.pattern is None or not spec.is_drafted:
        return ()
    return read_drafted(spec.pattern, replace(spec.draft_options, size=None)).sizes


def _fit_size(size: str, scene: Scene, maps: Sequence[str], device: str | None, caches: Caches) -> SizeFit:
    return measured_size(size, fit_loaded(lambda: scene, device, caches, maps=maps))


def unusable_size(size: str, message: str) -> SizeFit:
    """A size that cannot be fitted, and why."""
    return SizeFit(size, Status.INVALID.value, message, {}, None, None, None)


def measured_size(size: str, worn: Fit) -> SizeFit:
    """A size as it is worn, with what a recommendation needs; its girths are put into its report."""
    add_girths(worn)
    levels = _levels(worn) if worn.status is not Status.DIVERGED else {}
    strain, held = worn.report["strain"], not any(problem.code in UNHELD for problem in worn.problems)
    return SizeFit(size, worn.status.value, worn.message, levels, strain["p50"], strain["p99"], worn, held, worn.worn)


def _levels(worn: Fit) -> dict[str, LevelFit]:
    """The levels at which the first garment encloses the trunk."""
    found = {}
    for row in worn.report["girths_mm"]:
        if row["closed"] and row["garment"] == worn.garments[0].name:
            height, body, cut, as_worn = (
                1e-3 * row[key] for key in ("height", "body_girth", "natural_girth", "garment_girth")
            )
            found[row["level"]] = LevelFit(height, body, cut, as_worn / cut - 1.0)
    return found


def recommendation(sizes: Sequence[SizeFit], wanted: float) -> tuple[str | None, str]:
    """The smallest size with enough ease at every level and little strain, and the reason in one sentence."""
    usable = [each for each in sizes if each.fit is not None and each.status != Status.DIVERGED.value]
    if not usable:
        return None, "No size could be fitted; see each one's message."
    usable = [each for each in usable if each.held]
    if not usable:
        return None, "No size stays up on this body: each falls off, or slides down to the feet."
    for index, each in enumerate(usable):
        problem = _too_tight(each, wanted)
        if not problem:
            before = _too_tight(usable[index - 1], wanted) if index else ""
            why = f"; {usable[index - 1].size} is too tight: {before}" if before else "; it is the smallest size"
            return each.size, f"it {_closest(each)}{why}.{_unsure(each)}"
    last = usable[-1]
    largest = "the largest size" + (" that stays up" if last is not sizes[-1] else "")
    return last.size, f"it is {largest}, though too tight: {_too_tight(last, wanted)}.{_unsure(last)}"


def _unsure(each: SizeFit) -> str:
    """A caution where the garment was still moving when it was measured, or has problems."""
    if each.status != Status.AT_REST.value:
        return " It did not come to rest, so its ease may still change."
    return "" if each.worn else " It is not worn as it should be: its report says why."


def _too_tight(each: SizeFit, wanted: float) -> str:
    """Why a size is too tight; empty where it is not."""
    for name, level in sorted(each.levels.items(), key=lambda entry: entry[1].ease):
        if level.ease < wanted:
            return f"{100 * level.ease:.1f} cm of ease at the {name} (wanted {100 * wanted:.1f})"
    if each.strain_p99 is not None and each.strain_p99 > MOST_STRETCH:
        limit = 100 * MOST_STRETCH
        return f"its cloth is strained by {100 * each.strain_p99:.0f} % (99th percentile; at most {limit:.0f})"
    return ""


def _closest(each: SizeFit) -> str:
    """Where a size is closest to the body, in words."""
    if not each.levels:
        strain = f"strains its cloth by {100 * (each.strain_p99 or 0.0):.1f} % at most (99th percentile)"
        return f"{strain}, though no chest, waist or hip was found that it goes around"
    name, level = min(each.levels.items(), key=lambda entry: entry[1].ease)
    return f"leaves {100 * level.ease:.1f} cm at the {name}, where it is closest"
