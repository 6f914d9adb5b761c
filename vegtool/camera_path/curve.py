"""A smooth curve through points, walked at a constant speed.

Yuksel, Schaefer, Keyser: Parameterization and applications of Catmull-Rom curves (2011): with
knots as far apart as the square roots of the points' distances (centripetal), a curve neither
crosses itself nor has a cusp between two points, and stays near its chords however unevenly the
points are spaced. Ends are carried on by reflection, so that a curve of two points is straight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from vegtool.arrays import FloatArray

PIECES = 64
"""Of a leg: within each, speed is taken to change linearly with the parameter."""

Legs = npt.NDArray[np.int64]
"""(k,) which legs."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A cubic for each leg, from one point to the next; a closed curve has a leg back to the first.

    points: (n, 3) metres. closed: whether it is. start, end: (l,) int, points of each leg.
    node: (n,) int, which of the places a point is at: neighbours at one place share it.
    spacing: (places,) between each place's knot and the next one's.
    length: (l,) metres along each leg; 0 where both its points are at one place.
    walked, speed: (l, PIECES + 1) metres from the leg's start, and metres by its parameter, at
    parameters that are evenly spaced.
    """

    points: FloatArray
    closed: bool
    start: Legs
    end: Legs
    node: Legs
    spacing: FloatArray
    length: FloatArray
    walked: FloatArray
    speed: FloatArray

    @property
    def tangents(self) -> FloatArray:
        """(n, 3) the way that the curve goes at each point, of any length; zeros where it turns
        back or stays."""
        return self._slopes(self.points)[self.node]

    def parameter(self, leg: Legs, fraction: FloatArray) -> FloatArray:
        """(k,) 0 to 1, where on its leg one is after a fraction, 0 to 1, of its length."""
        walked = self.walked[leg]
        wanted = fraction * walked[:, -1]
        piece = np.clip((walked <= wanted[:, None]).sum(axis=1) - 1, 0, PIECES - 1)
        k = np.arange(len(leg))
        before, after = walked[k, piece], walked[k, piece + 1]
        rest = np.clip(_ratio(wanted - before, after - before, 0.0), 0.0, 1.0)
        # speed changes linearly from v to 2 - v, in units of its mean: v x + (1 - v) x^2 = rest
        first, last = self.speed[leg, piece], self.speed[leg, piece + 1]
        v = _ratio(2 * first, first + last, 1.0)
        root = np.sqrt(np.maximum(v * v + 4 * (1 - v) * rest, 0.0))
        return np.asarray((piece + np.minimum(_ratio(2 * rest, v + root, 0.0), 1.0)) / PIECES)

    def at(self, leg: Legs, parameter: FloatArray, values: FloatArray) -> FloatArray:
        """(k, c) what is at (n, c) values at the points, interpolated as the points are."""
        u = parameter[:, None]
        p, q, m, n = self._ends(values)
        return np.asarray(
            (1 + 2 * u) * (1 - u) ** 2 * p[leg]
            + u * (1 - u) ** 2 * m[leg]
            + u * u * (3 - 2 * u) * q[leg]
            - u * u * (1 - u) * n[leg]
        )

    def _ends(self, values: FloatArray) -> tuple[FloatArray, ...]:
        """(l, c) values and slopes by the leg's parameter, at the start and the end of each leg."""
        slopes = self._slopes(values)
        h = np.where(self.length > 0, self.spacing[self.node[self.start]], 0.0)[:, None]
        return (
            values[self.start],
            values[self.end],
            h * slopes[self.node[self.start]],
            h * slopes[self.node[self.end]],
        )

    def _slopes(self, values: FloatArray) -> FloatArray:
        """(places, c) by the knots' parameter: that of the parabola through a place and its two
        neighbours, which is what Catmull and Rom's blending comes to."""
        at = np.zeros((len(self.spacing), values.shape[1]))
        at[self.node[::-1]] = values[::-1]  # the first point of those at one place
        if len(at) == 1:
            return np.zeros_like(at)
        step = np.roll(at, -1, axis=0) - at
        h = self.spacing[:, None]
        before_step, before_h = np.roll(step, 1, axis=0), np.roll(h, 1, axis=0)
        if not self.closed:  # reflection: the step before the first is the first, and so on
            step[-1], h = step[-2], np.concatenate([h[:-1], h[-2:-1]])
            before_step[0], before_h[0] = step[0], h[0]
        across = (step + before_step) / (h + before_h)
        return np.asarray(step / h + before_step / before_h - across)


def through(points: FloatArray, closed: bool = False) -> Curve:
    """The curve through points (n, 3), metres; of one point, without a leg unless it is closed."""
    count = len(points)
    start = np.arange(count if closed else count - 1)
    end = (start + 1) % count
    apart = np.linalg.norm(points[end] - points[start], axis=1)
    moves = apart > 0
    node = np.concatenate([[0], np.cumsum(moves[: count - 1])]).astype(np.int64)
    if closed and not moves[-1]:  # the last points are where the first one is
        node[node == node[-1]] = 0
    spacing = np.ones(node.max() + 1)
    spacing[node[start[moves]]] = np.sqrt(apart[moves])
    empty = np.zeros((len(start), PIECES + 1))
    curve = Curve(points, closed, start, end, node, spacing, apart, empty, empty)
    return _measured(curve)


def _measured(curve: Curve) -> Curve:
    """The curve with its lengths: Simpson's rule on each piece."""
    u = np.linspace(0.0, 1.0, 2 * PIECES + 1)[None, :, None]
    p, q, m, n = (each[:, None] for each in curve._ends(curve.points))
    # the derivative, written so that nothing cancels far from the origin
    way = 6 * u * (1 - u) * (q - p) + (1 - u) * (1 - 3 * u) * m - u * (2 - 3 * u) * n
    speed = np.linalg.norm(way, axis=2)
    piece = (speed[:, :-2:2] + 4 * speed[:, 1::2] + speed[:, 2::2]) / (6 * PIECES)
    walked = np.concatenate([np.zeros((len(piece), 1)), np.cumsum(piece, axis=1)], axis=1)
    return replace(curve, length=walked[:, -1], walked=walked, speed=speed[:, ::2])


def _ratio(a: FloatArray, b: FloatArray, otherwise: float) -> FloatArray:
    """a / b, and something else where b is 0."""
    return np.divide(a, b, out=np.full_like(a, otherwise), where=b > 0)
