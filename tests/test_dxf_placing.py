"""Where the pieces of a DXF pattern start: bands at the edges that they are sewn to, sleeves clear of the trunk."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dxf_patterns import Drafted, hooded, sleeve, tshirt, write
from dxf_sewn_in import banded_skirt, kimono
from dxf_shirts import shirt, write_shirt

from warp_cloth.anatomy.linking import Wearing
from warp_cloth.anatomy.openings import ARMS
from warp_cloth.dressing.routes import Route, limb_routes
from warp_cloth.garment.outfit import load_outfit
from warp_cloth.pattern import load_pattern
from warp_cloth.scene import load_scene

EDGE = 0.03  # [m]


def posed_for(path: Path, body: Path) -> tuple[Wearing, list[Route | None], Wearing]:
    """A pattern's garment on a body, the ways of the limbs into it, and the same on the body posed so."""
    scene = load_scene({"garment": {"pattern": str(path), "edge_mm": 1e3 * EDGE}, "avatar": {"mesh": str(body)}})
    (wearing,) = load_outfit(scene).wearing
    assert wearing is not None
    skeleton, routes = wearing.skeleton, limb_routes(wearing, wearing.start)
    curves = tuple(home if route is None else route.curve for home, route in zip(skeleton.curves, routes, strict=True))
    return wearing, routes, replace(wearing, skeleton=replace(skeleton, curves=curves))


def test_waistbands_in_two_start_before_and_behind_what_they_are_sewn_to(tmp_path: Path) -> None:
    mesh = load_pattern(write(tmp_path / "skirt.dxf", {"M": banded_skirt()}), edge=EDGE)
    assert mesh.panels is not None
    ends = mesh.points[mesh.triangles]
    middle = {name: ends[mesh.panels == number].mean(axis=(0, 1)) for number, name in enumerate(mesh.panel_names)}
    assert middle["WAISTBAND FRONT"][2] > 0.03 > -0.03 > middle["WAISTBAND BACK"][2]
    assert abs(middle["WAISTBAND FRONT"][0]) < 0.01
    assert np.linalg.norm(ends - np.roll(ends, 1, axis=1), axis=2).max() < 4.0 * EDGE


@pytest.mark.parametrize("first", [0, 2])
def test_a_band_starts_with_its_sewn_side_at_what_it_is_sewn_to(first: int, tmp_path: Path) -> None:
    """Whichever way up it was drafted: laid the other way round, its seam would lie in the middle of the limb."""
    pieces = [
        replace(each, edges=[*each.edges[first:], *each.edges[:first]]) if each.name in ("Cuff", "Hem Band") else each
        for each in hooded()
    ]
    mesh = load_pattern(write(tmp_path / "hooded.dxf", {"M": pieces}), edge=EDGE)
    assert mesh.panels is not None
    bands = [number for number, name in enumerate(mesh.panel_names) if name.startswith(("Cuff", "Hem Band"))]
    assert len(bands) == 3
    corners = mesh.points[mesh.triangles[np.isin(mesh.panels, bands)]]
    assert np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max() < 2.0 * EDGE


def test_sleeves_of_a_body_with_its_arms_down_start_raised_and_its_arms_with_them(
    tmp_path: Path, shared_data: Path
) -> None:
    path = write(tmp_path / "hooded.dxf", {"M": hooded()})
    body = shared_data / "anny/female_avg_arms_down.obj"
    wearing, routes, posed = posed_for(path, body)
    assert wearing.start_fault
    raised = [routes[arm] for arm in ARMS]
    assert all(route is not None and route.is_raised for route in raised)
    assert not posed.misplaced(posed.start)
    assert not posed.pierced(posed.start)


@pytest.mark.parametrize("pieces", [shirt(), kimono(False)], ids=["open in front", "sleeves cut in one"])
def test_arms_go_out_through_the_sleeves(pieces: list[Drafted], tmp_path: Path, shared_data: Path) -> None:
    """A way out by an open front or the neck, round, and in at the cuff is clear of cloth, too."""
    path = write_shirt(pieces, tmp_path / "shirt.dxf") if len(pieces) > 2 else write(tmp_path / "a.dxf", {"M": pieces})
    *_, posed = posed_for(path, shared_data / "garmentcode/mean_all.obj")
    assert not posed.misplaced(posed.start)


def test_a_sleeve_of_little_but_its_cap_starts_as_far_out_as_a_longer_one(tmp_path: Path) -> None:
    """It would be drawn into the bodice with its cap before that is sewn in."""
    ends = []
    for long in (18.0, 28.0):
        pieces = [
            sleeve(piece.name, 18.0, long, 16.0, 23.0, 23.0) if "SLEEVE" in piece.name else piece for piece in tshirt()
        ]
        mesh = load_pattern(write(tmp_path / "tee.dxf", {"M": pieces}), edge=EDGE)
        assert mesh.panels is not None
        own = [number for number, name in enumerate(mesh.panel_names) if name.startswith("SLEEVE")]
        ends.append(mesh.points[mesh.triangles[np.isin(mesh.panels, own)]][..., 0].max())
    assert ends[0] == pytest.approx(ends[1], abs=0.01)
