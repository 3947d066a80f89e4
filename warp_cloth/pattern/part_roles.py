"""What the edges of a part are, by its kind and shape, and on which side of the wearer a half is."""

from __future__ import annotations

from warp_cloth.pattern.bodices import arm_side, bodice_roles
from warp_cloth.pattern.kinds import BOTH, COLLARS, HALF_SLEEVES, LEFT, RIGHT, SKIRTS, STRIPS, YOKES
from warp_cloth.pattern.leg_openings import with_leg_openings
from warp_cloth.pattern.lower_sleeves import LOWER_SLEEVE
from warp_cloth.pattern.panel_roles import (
    godet_roles,
    half_sleeve_roles,
    legged_roles,
    middle_side,
    side_panel_roles,
    yoke_roles,
    yoked_roles,
)
from warp_cloth.pattern.roles import (
    Roles,
    Shape,
    collar_roles,
    hood_roles,
    is_strip,
    leg_roles,
    pants_roles,
    skirt_roles,
    sleeve_roles,
    strip_roles,
)


def roles_of(kind: str, shape: Shape, whole: bool, has_side_panels: bool, has_yoke: bool) -> Roles:
    """The edges of a part by their roles, as far as its kind and shape tell.

    Args:
        kind: of the part.
        shape: its outline, upright.
        whole: it is symmetric, with its middle within it.
        has_side_panels: it is a front or back that goes on in side panels.
        has_yoke: or one below a yoke.
    """
    if len(shape.order) < 3:
        return {}
    if kind in YOKES:
        return yoke_roles(shape, whole)
    if has_yoke and (below := yoked_roles(shape, whole)):
        return below
    if kind in ("front", "back") and not whole and not has_side_panels and (legged := legged_roles(shape)):
        return legged
    if kind in ("front", "back"):
        roles = bodice_roles(shape, whole, middle_side if has_side_panels else arm_side)
        return with_leg_openings(shape, roles, whole)
    if kind in ("side_front", "side_back"):
        return side_panel_roles(shape)
    if kind in ("leg_front", "leg_back"):
        return leg_roles(shape)
    if kind == "leg":
        return pants_roles(shape)
    if kind in ("sleeve", "under_sleeve", LOWER_SLEEVE):
        return sleeve_roles(shape)
    if kind in HALF_SLEEVES:
        return half_sleeve_roles(shape)
    if kind == "godet":
        return godet_roles(shape)
    if kind == "hood":  # or the strip between its halves
        return strip_roles(shape) if whole and is_strip(shape) else hood_roles(shape)
    if kind.removeprefix("side_") in ("skirt_front", "skirt_back", "gore"):
        return skirt_roles(shape)
    if kind in (*STRIPS, "strap") and is_strip(shape, is_named=True) and (found := strip_roles(shape)):
        return found
    return collar_roles(shape) if kind in COLLARS else {}


def side_of(kind: str, shape: Shape, roles: Roles, whole: bool) -> int:
    """The wearer's side of a half piece by where its middle is: a front's +x is the wearer's left, a back's right."""
    if whole:
        return BOTH
    faced = -1 if kind in ("back", "leg_back", "skirt_back", "side_back", "yoke", "back_sleeve") else 1
    if (kind in ("front", "back", *YOKES, *SKIRTS) and "centre" in roles) or (
        kind in ("side_front", "side_back") and "princess" in roles
    ):
        outer = ("side+", "armhole+", "shoulder+", "princess+")
        return faced * (LEFT if any(role in roles for role in outer) else RIGHT)
    if kind in ("leg_front", "leg_back", *HALF_SLEEVES):
        return faced * LEFT if "inner-" in roles else faced * RIGHT if "inner+" in roles else BOTH
    if kind == "leg" and "crotch+" in roles:  # its back is cut out farther; at +x on the wearer's left
        return LEFT if shape.length(roles["crotch+"]) > shape.length(roles["crotch-"]) else RIGHT
    if kind == "hood":  # seen from outside, the face is towards +x on the wearer's right
        return RIGHT if "face+" in roles else LEFT if "face-" in roles else BOTH
    return BOTH
