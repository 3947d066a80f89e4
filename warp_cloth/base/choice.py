"""A choice that the program made where a scene says "auto", for the report."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Choice:
    """What was chosen for a key of the scene, and why, in one line."""

    key: str  # of the scene: "garment.rest", "garment[1].rest"
    value: str | float | bool | tuple[float, ...]  # as the scene could state it
    reason: str
