"""Where a panel starts that is laid round a part of the body: rolled about a line, level by level."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warp_cloth.pattern.curve import Floats

FLAT = 1e-6  # [1/m]
SLOPE = 0.35  # [m per m] by which a cone starts wider as it goes down: as steep as that, few arms are in its way
UP = np.array([0.0, 1.0, 0.0])
MIRROR = np.array([-1.0, 1.0])  # of a panel's x and y, seen from its other side


@dataclass(frozen=True, eq=False)
class Wrap:
    """A panel as levels along ``along``, each rolled into an arc of its own curvature.

    A point x beside the level's centre, at angle a = curvature x, starts at ``origin + across sin(a) / curvature -
    outward (1 - cos(a)) / curvature``. Between levels, and beyond the last ones, these go on linearly.
    """

    along: Floats  # unit vector of the panel, up the levels, shape [2]
    levels: Floats  # [m] along it, rising, shape [L], L >= 2
    centre: Floats  # [m] across it, shape [L]
    curvature: Floats  # [1/m], shape [L]
    origin: Floats  # [m], shape [L, 3]
    across: Floats  # directions, shape [L, 3]; longer than 1 where the cloth starts stretched
    outward: Floats

    def placed(self, points: Floats) -> Floats:
        """Points of the panel [m], shape [N, 2], where they start, shape [N, 3]."""
        y = points @ self.along
        x = points @ np.array([self.along[1], -self.along[0]])
        span = np.clip(np.searchsorted(self.levels, y) - 1, 0, len(self.levels) - 2)
        step = self.levels[span + 1] - self.levels[span]
        beyond = (y - self.levels[span]) / step
        within = np.clip(beyond, 0.0, 1.0)

        def between(values: Floats, share: Floats) -> Floats:
            share = share if values.ndim == 1 else share[:, None]
            return np.asarray(values[span] + share * (values[span + 1] - values[span]))

        bend = between(self.curvature, within)
        bend = np.where(np.abs(bend) < FLAT, FLAT, bend)
        aside = x - between(self.centre, within)
        angle = np.clip(bend * aside, -np.pi, np.pi)
        rest = aside - angle / bend  # what is longer than a whole turn goes on straight
        side = np.sin(angle) / bend + rest
        back = (1.0 - np.cos(angle)) / bend
        return np.asarray(
            between(self.origin, beyond)
            + side[:, None] * between(self.across, within)
            - back[:, None] * between(self.outward, within)
        )

    def upside_down(self) -> Wrap:
        """Of the panel turned by half."""
        return replace(self, along=-self.along)

    def mirrored(self) -> Wrap:
        """Of the panel seen from the other side, where x runs the other way."""
        return replace(self, along=self.along * MIRROR, centre=-self.centre, across=-self.across)

    def farther_out(self, apart: float) -> Wrap:
        """Laid outside of where it was, by so much [m], and as much wider where it is bent round something."""
        wider = 1.0 + apart * np.abs(self.curvature)[:, None]
        out = self.outward / np.linalg.norm(self.outward, axis=1, keepdims=True)
        return replace(self, origin=self.origin + apart * out, across=self.across * wider, outward=self.outward * wider)


@dataclass(frozen=True, eq=False)
class Cone:
    """A panel that is part of a ring, laid as part of a cone round the trunk, its inner arc on top.

    A point at angle a round the ring's centre, from ``angles[0]`` to ``angles[1]``, starts at the angle in proportion
    between ``around[0]`` and ``around[1]`` round the trunk, as far below its top as it is from the inner arc.
    """

    centre: Floats  # of the ring, in the panel [m], shape [2]
    up: Floats  # unit vector of the panel; angles are from against it, rising to the right of it, shape [2]
    radius: float  # of the inner arc [m]
    angles: tuple[float, float]  # [rad]
    around: tuple[float, float]  # [rad], 0 in front, rising to the wearer's left
    top: Floats  # the trunk's middle at the top [m], shape [3]
    left: Floats  # the wearer's, as long as half the trunk is wide there, shape [3]
    forward: Floats

    def placed(self, points: Floats) -> Floats:
        """Points of the panel [m], shape [N, 2], where they start, shape [N, 3]."""
        away = points - self.centre
        down, aside = -(away @ self.up), away @ np.array([self.up[1], -self.up[0]])
        share = (np.arctan2(aside, down) - self.angles[0]) / (self.angles[1] - self.angles[0])
        angle = (self.around[0] + share * (self.around[1] - self.around[0]))[:, None]
        below = (np.hypot(down, aside) - self.radius)[:, None]
        left, forward = (way * (1.0 + SLOPE * below / float(np.linalg.norm(way))) for way in (self.left, self.forward))
        fall = below * float(np.sqrt(1.0 - SLOPE**2))
        return np.asarray(self.top + np.sin(angle) * left + np.cos(angle) * forward - fall * UP)

    def upside_down(self) -> Cone:
        """Of the panel turned by half."""
        return replace(self, centre=-self.centre, up=-self.up)

    def mirrored(self) -> Cone:
        """Of the panel seen from the other side, where x runs the other way."""
        first, last = self.angles
        return replace(self, centre=self.centre * MIRROR, up=self.up * MIRROR, angles=(-first, -last))

    def farther_out(self, apart: float) -> Cone:
        """Itself: it stands away from the trunk as it is."""
        return self


@dataclass(frozen=True, eq=False)
class Ring:
    """A band whose ends are sewn together, standing on a closed line round which it is sewn.

    A point a share s of the way from one end to the other starts above the line's point there, as far as it is from the
    sewn edge.
    """

    first: Floats  # points along the one end, shape [N, 2]
    last: Floats  # and the other
    edge: Floats  # points along the sewn edge [m], shape [M, 2]
    shares: Floats  # of the way from end to end of these points, rising, shape [M]
    along: Floats  # fraction of the line at these points, rising, shape [M]
    line: Floats  # points of the line [m], shape [M, 3]
    up: Floats  # unit vector, shape [3]

    @classmethod
    def of(cls, first: Floats, last: Floats, edge: Floats, along: Floats, line: Floats, up: Floats) -> Ring:
        """``along``: fraction of the sewn edge's length at its points."""
        shares = np.maximum.accumulate(_share(edge, first, last))
        return cls(first, last, edge, shares, along, line, up)

    def placed(self, points: Floats) -> Floats:
        """Points of the band [m], shape [N, 2], where they start, shape [N, 3]."""
        at = np.interp(_share(points, self.first, self.last), self.shares, self.along)
        on_line = np.column_stack([np.interp(at, self.along, axis) for axis in self.line.T])
        return np.asarray(on_line + _distance(points, self.edge)[:, None] * self.up)


def _share(points: Floats, first: Floats, last: Floats) -> Floats:
    """How far points are on the way from one line to another, from 0 to 1."""
    near, far = _distance(points, first), _distance(points, last)
    return np.asarray(near / np.maximum(near + far, 1e-12))


def _distance(points: Floats, line: Floats) -> Floats:
    """Distance of points from a polyline [m], shape [N]."""
    start, step = line[:-1], np.diff(line, axis=0)
    off = points[:, None] - start
    share = np.clip((off * step).sum(axis=2) / np.maximum((step * step).sum(axis=1), 1e-18), 0.0, 1.0)
    return np.asarray(np.linalg.norm(off - share[..., None] * step, axis=2).min(axis=1))


Laid = Wrap | Cone  # round the body


def flat_wrap(along: Floats, place: Floats, origin: Floats, across: Floats, upward: Floats) -> Wrap:
    """A flat panel: its point ``place``, shape [2], at ``origin``; ``along`` of the panel runs ``upward``."""
    centre = float(place @ np.array([along[1], -along[0]]))
    level = float(place @ along)
    outward = np.cross(across, upward)
    return Wrap(
        along,
        np.array([level, level + 1.0]),
        np.array([centre, centre]),
        np.zeros(2),
        np.stack([origin, origin + upward]),
        np.stack([across, across]),
        np.stack([outward, outward]),
    )
