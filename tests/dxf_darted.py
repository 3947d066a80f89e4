"""A top drafted for tests whose darts are inner lines: a V at the bust, from the side, and a fish-eye in the back."""

from __future__ import annotations

from dataclasses import replace

from dxf_patterns import TRUE_SEAMS, Drafted, Point, band, half_body, length, line, sleeve

MOUTH, BUST = 3.0, 11.0  # [cm] of the V at the side seam, and how far it reaches
EYE = (1.5, 12.0)  # [cm] half the width and height of the fish-eye
TRUE_DARTED_SEAMS = TRUE_SEAMS["tshirt"] | {"dart": 2}


def v(width: float, top: float) -> list[Point]:
    """The V's legs, from the side to the tip and back."""
    return [(width, top), (width - BUST, top - 0.5 * MOUTH), (width, top - MOUTH)]


def fish_eye(x: float, y: float) -> list[Point]:
    wide, high = EYE
    return [(x, y + high), (x + wide, y), (x, y - high), (x - wide, y), (x, y + high)]


def darted(grade: float = 0.0) -> list[Drafted]:
    """The T-shirt, its front longer at the side by what the V takes in."""
    width, long = 26.0 + grade, 70.0 + 1.5 * grade
    front = half_body("FRONT", width, long, 8.5, 9.5, 22.0 + 0.7 * grade)
    back = half_body("BACK", width, long, 8.5, 2.5, 22.0 + 0.7 * grade)
    under, low = front.edges[1][-1], front.edges[4][-1]
    hem: list[Point] = [(0.0, -MOUTH), (width, -MOUTH)]
    front = replace(
        front,
        edges=[line(*hem), line(hem[1], under), *front.edges[2:5], line(low, hem[0])],
        fold=(low, hem[0]),
        inner=[v(width, under[1] - 5.0)],
    )
    back = replace(back, inner=[fish_eye(10.0, 30.0)])
    arm = sleeve("SLEEVE", 18.0 + 0.6 * grade, 34.0, 16.0 + 0.5 * grade, length(front.edges[2]), length(back.edges[2]))
    neck = 2.0 * (length(front.edges[4]) + length(back.edges[4]))
    return [front, back, arm, band("NECKBAND", 0.9 * neck, 2.0)]
