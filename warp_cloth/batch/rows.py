"""Results of an item: its row of the results table, and the worn points where they are to be stored."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_cloth.base.mesh import Indices, Points

if TYPE_CHECKING:
    from warp_cloth.fitting.fit import Fit

FAILED = "failed"  # status of an item that the machine could not finish; "invalid": its input is bad

# Columns of the results table and their keys in the report; nothing that differs from run to run.
FIGURES: dict[str, tuple[str, ...]] = {
    "vertices": ("vertices",),
    "iterations": ("iterations",),
    "residual_rms": ("residual", "rms"),
    "residual_p99": ("residual", "p99"),
    "residual_max": ("residual", "max"),
    "relative_rms": ("residual", "relative_rms"),
    "relative_p99": ("residual", "relative_p99"),
    "rest_error_mm": ("rest_error_mm",),
    "strain_p50": ("strain", "p50"),
    "strain_p99": ("strain", "p99"),
    "strain_max": ("strain", "max"),
    "strain_min": ("strain", "min"),
    "penetration_max_mm": ("penetration_mm", "max"),
    "penetration_p999_mm": ("penetration_mm", "p999"),
    "penetration_fraction": ("penetration_mm", "fraction"),
}
EASE = {"ease_chest_cm": "chest", "ease_waist_cm": "waist", "ease_hip_cm": "hip"}  # and their levels
GIRTH = {"girth_chest_cm": "chest", "girth_waist_cm": "waist", "girth_hip_cm": "hip"}
INTEGERS = ("vertices", "iterations")
COLUMNS = ("name", "status", "worn", "problems", "message", *EASE, *GIRTH, *FIGURES, "digest", "file")


@dataclass(frozen=True)
class WornPoints:
    """One garment of one item, as a packed file stores it."""

    garment: str
    points: Points  # [m], shape [V, 3]
    triangles: Indices  # shape [F, 3]
    vertex_map: NDArray[np.int64] | None = None  # which of these points each vertex of the file became (base.mesh)


@dataclass(frozen=True)
class ItemResult:
    """An item's row, and its worn garments where they are to be packed."""

    row: dict[str, Any]
    worn: tuple[WornPoints, ...] = ()


def row_of(name: str, fit: Fit, file: str, *, ease: bool = True) -> dict[str, Any]:
    """The row of a finished fit; ``file`` is where its shape is stored; ``ease``: whether it is measured."""
    codes = [problem.code.value for problem in fit.problems]
    row: dict[str, Any] = {"name": name, "status": fit.status.value, "worn": fit.worn, "problems": codes}
    row["message"] = fit.message
    tightest = tightest_girths(fit) if ease else {}
    row |= {column: _centimetres(tightest.get(level), "ease") for column, level in EASE.items()}
    row |= {column: _centimetres(tightest.get(level), "garment_girth") for column, level in GIRTH.items()}
    for column, keys in FIGURES.items():
        row[column] = _at(fit.report, keys)
    row["digest"] = points_digest([worn.points for worn in fit.garments])
    row["file"] = file
    return row


def tightest_girths(fit: Fit) -> dict[str, Mapping[str, Any]]:
    """By level the girths [mm] of the garment that goes round it with the least ease."""
    from warp_cloth.maps.measure import add_girths

    add_girths(fit)
    found: dict[str, Mapping[str, Any]] = {}
    for girths in fit.report["girths_mm"]:
        level, ease = girths["level"], girths["ease"]
        if ease is not None and (level not in found or ease < found[level]["ease"]):
            found[level] = girths
    return found


def _centimetres(girths: Mapping[str, Any] | None, name: str) -> float | None:
    """A length of a report's girths [mm] in cm, rounded as ``fit.ease`` is."""
    return None if girths is None else 100.0 * (1e-3 * float(girths[name]))


def empty_row(name: str, status: str, message: str) -> dict[str, Any]:
    """The row of an item without a fit: status and reason, no figures."""
    unworn = {"worn": False, "problems": []}
    return {**dict.fromkeys(COLUMNS), **unworn, "name": name, "status": status, "message": message}


def points_digest(garments: list[Points]) -> str:
    """A hash of the worn points' bits."""
    digest = hashlib.sha256()
    for points in garments:
        digest.update(np.ascontiguousarray(points, dtype=np.float64).tobytes())
    return digest.hexdigest()[:32]


def _at(report: Mapping[str, Any], keys: tuple[str, ...]) -> Any:
    value: Any = report
    for key in keys:
        if not isinstance(value, Mapping):
            return None
        value = value.get(key)
    return value
