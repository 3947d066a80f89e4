"""The collider of an avatar as the solver takes it: a device function for signed distances and its data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import warp as wp


@dataclass(frozen=True, eq=False)
class Collider:
    """A device function that returns the avatar's signed distance, and its arguments; by default there is no avatar."""

    avatar_contact: wp.Function | None = None  # (data, world position [m]) -> (unit normal, signed distance [m])
    data: Any = None  # struct that the function reads
    data_type: Any = None  # that struct's type
