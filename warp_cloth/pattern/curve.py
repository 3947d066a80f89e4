"""Curves of a panel's outline in the plane: lines, circular arcs, quadratic and cubic Bezier curves.

Lengths and areas are exact, but for the lengths of Bezier curves, which are integrated to 1e-12.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TABLE = 65  # places of a curve between which its parameter is found from the length
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)  # exact to degree 15 within each of the table's spans


@dataclass(frozen=True, eq=False)
class Curve:
    """One edge of an outline, from ``points[0]`` to ``points[-1]``.

    ``points`` [m], shape [2, 2] for a line and an arc, [3, 2] or [4, 2] for a quadratic or cubic Bezier curve.
    An arc turns by ``turn`` [rad] about its centre, counter-clockwise where positive.
    """

    points: Floats
    turn: float = 0.0  # of an arc; 0: no arc

    @property
    def start(self) -> Floats:
        return self.points[0]

    @property
    def end(self) -> Floats:
        return self.points[-1]

    @property
    def is_line(self) -> bool:
        return len(self.points) == 2 and self.turn == 0.0

    @property
    def reversed(self) -> Curve:
        """The same curve from its end to its start."""
        return Curve(self.points[::-1], -self.turn)

    @cached_property
    def chord(self) -> float:
        """Distance of the ends [m]."""
        return float(np.hypot(*(self.end - self.start)))

    @cached_property
    def radius(self) -> float:
        """Radius of an arc [m]."""
        return 0.5 * self.chord / math.sin(0.5 * abs(self.turn))

    @cached_property
    def centre(self) -> Floats:
        """Centre of an arc [m], shape [2]."""
        across = self.end - self.start
        left = np.array([-across[1], across[0]])
        return 0.5 * (self.start + self.end) + left * (0.5 / math.tan(0.5 * self.turn))

    @cached_property
    def length(self) -> float:
        """Arc length [m]."""
        if self.is_line:
            return self.chord
        if self.turn:
            return self.radius * abs(self.turn)
        return float(self._lengths[-1])

    @cached_property
    def _lengths(self) -> Floats:
        """Lengths of a Bezier curve from its start to even parameters."""
        return _arc_lengths(_derived(self._polynomial))

    @cached_property
    def area(self) -> float:
        """Its part of the area that the outline encloses [m^2]: half the integral of x dy - y dx along it.

        A Bezier curve's is the sum over pairs of control points of their cross product with the integrals of the
        Bernstein polynomials; an arc's is its chord's, and the segment of the circle beside it.
        """
        p = self.points
        chord = 0.5 * _cross(p[0], p[-1])
        if self.turn:
            return chord + 0.5 * self.radius**2 * (self.turn - math.sin(self.turn))
        if len(p) == 3:
            return (2 * _cross(p[0], p[1]) + 2 * _cross(p[1], p[2]) + _cross(p[0], p[2])) / 6
        if len(p) == 4:
            pairs = 6 * _cross(p[0], p[1]) + 3 * _cross(p[0], p[2]) + _cross(p[0], p[3])
            return (pairs + 3 * _cross(p[1], p[2]) + 3 * _cross(p[1], p[3]) + 6 * _cross(p[2], p[3])) / 20
        return chord

    def at(self, fractions: Floats) -> Floats:
        """The points at these fractions of the length, from 0 to 1, shape [N]; [m], shape [N, 2]."""
        if self.is_line:
            return self.start + np.asarray(fractions)[:, None] * (self.end - self.start)
        if self.turn:
            angle = self.turn * np.asarray(fractions)
            out, c, s = self.start - self.centre, np.cos(angle), np.sin(angle)
            turned = np.empty((len(angle), 2))
            turned[:, 0], turned[:, 1] = c * out[0] - s * out[1], s * out[0] + c * out[1]
            return self.centre + turned
        return _at(self._polynomial, self._parameters(fractions))

    def bends(self, fractions: Floats) -> Floats:
        """The curvature vectors at these fractions of the length [1/m], towards the centre, shape [N, 2]."""
        if self.is_line:
            return np.zeros((len(fractions), 2))
        if self.turn:
            return (self.centre - self.at(fractions)) / self.radius**2
        return self._bends(self._parameters(fractions))

    def with_bends(self, fractions: Floats) -> tuple[Floats, Floats]:
        """What ``at`` and ``bends`` return, in less time."""
        if len(self.points) == 2:
            return self.at(fractions), self.bends(fractions)
        t = self._parameters(fractions)
        return _at(self._polynomial, t), self._bends(t)

    def _bends(self, t: Floats) -> Floats:
        velocity = _derived(self._polynomial)
        first, second = _at(velocity, t), _at(_derived(velocity), t)
        speed = np.maximum(first[:, 0] ** 2 + first[:, 1] ** 2, 1e-12 * self.length**2)
        along = (first[:, 0] * second[:, 0] + first[:, 1] * second[:, 1]) / speed
        return np.asarray((second - along[:, None] * first) / speed[:, None])

    @cached_property
    def _polynomial(self) -> Floats:
        """Coefficients of a Bezier curve by rising powers of its parameter, shape [3 or 4, 2]."""
        p = self.points
        if len(p) == 3:
            return np.array([p[0], 2.0 * (p[1] - p[0]), p[0] - 2.0 * p[1] + p[2]])
        rise, curl = 3.0 * (p[1] - p[0]), 3.0 * (p[0] - 2.0 * p[1] + p[2])
        return np.array([p[0], rise, curl, p[3] - p[0] - rise - curl])

    def _parameters(self, fractions: Floats) -> Floats:
        """Parameters of a Bezier curve at fractions of its length."""
        lengths, velocity = self._lengths, _derived(self._polynomial)
        wanted = np.minimum(np.maximum(fractions, 0.0), 1.0) * lengths[-1]
        spans = TABLE - 1
        span = np.minimum(np.searchsorted(lengths, wanted, side="right") - 1, spans - 1)
        low, base = span / spans, lengths[span]
        most, least = (span + 1) / spans, 1e-9 * lengths[-1]
        t = (span + (wanted - base) / np.maximum(lengths[span + 1] - base, 1e-300)) / spans
        for _ in range(2):  # Newton's steps; the integral from the span's start is by the same rule
            half = 0.5 * (t - low)
            reached = base + half * (_speeds(velocity, low[:, None] + half[:, None] * (_NODES + 1.0)) @ _WEIGHTS)
            speed = np.maximum(_speeds(velocity, t), least)
            t = np.minimum(np.maximum(t - (reached - wanted) / speed, low), most)
        return np.asarray(t)


def arc(start: Floats, end: Floats, radius: float, large: bool, right: bool) -> Curve:
    """The arc of a circle from start to end, as SVG's: large or small, counter-clockwise where ``right``.

    A radius shorter than half the chord is taken as half the chord (SVG 1.1, appendix F.6.6).
    """
    half = 0.5 * float(np.hypot(*(end - start)))
    turn = 2.0 * math.asin(min(1.0, half / radius))
    turn = 2.0 * math.pi - turn if large else turn
    return Curve(np.array([start, end]), turn if right else -turn)


def from_edge_frame(start: Floats, end: Floats, relative: Floats) -> Floats:
    """Points given relative to an edge, x along it and y to its left, both in units of its chord; shape [N, 2]."""
    along = end - start
    left = np.array([-along[1], along[0]])
    return start + relative[:, :1] * along + relative[:, 1:] * left


def to_edge_frame(start: Floats, end: Floats, points: Floats) -> Floats:
    """The inverse of ``from_edge_frame``."""
    along = end - start
    left = np.array([-along[1], along[0]])
    return np.asarray((points - start) @ np.column_stack([along, left]) / (along @ along))


def _cross(a: Floats, b: Floats) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _at(polynomial: Floats, t: Floats) -> Floats:
    """Values of a polynomial in the plane, coefficients by rising powers, shape [k, 2], by Horner's rule; [N, 2]."""
    values = np.empty((len(t), 2))
    values[:, 0], values[:, 1] = (_along(polynomial[:, axis], t) for axis in range(2))
    return values


def _along(coefficients: Floats, t: Floats) -> Floats:
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1].tolist():
        value = value * t + coefficient
    return np.asarray(value)


def _derived(polynomial: Floats) -> Floats:
    """The derivative of a polynomial."""
    return polynomial[1:] * np.arange(1.0, len(polynomial))[:, None]


def _speeds(velocity: Floats, t: Floats) -> Floats:
    """Lengths of a polynomial's values at ``t``, of any shape."""
    return np.asarray(np.sqrt(_along(velocity[:, 0], t) ** 2 + _along(velocity[:, 1], t) ** 2))


def _arc_lengths(velocity: Floats) -> Floats:
    """Lengths of a Bezier curve from its start to TABLE even parameters [m], shape [TABLE]; by Gauss's rule."""
    half = 0.5 / (TABLE - 1)
    at = np.arange(TABLE - 1)[:, None] / (TABLE - 1) + half * (_NODES + 1.0)
    return np.concatenate([[0.0], np.cumsum(half * (_speeds(velocity, at) @ _WEIGHTS))])
