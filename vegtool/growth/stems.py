"""The skeleton: all stems of a plant as curves, one array per branching level.

After J. Weber, J. Penn, "Creation and rendering of realistic trees", SIGGRAPH 1995: each level has
a length, taper, curve and down angle, children turn about their parent by the golden angle, and an
envelope shapes the crown. Growth towards or away from the light (their vertical attraction) bends
every stem as it grows. Instead of a number of children per stem, a level has a number of stems in
all, laid out evenly along its parents end to end: crowded stems are then never the rule.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray, IntArray, unit
from vegtool.growth.species import StemLevel

GOLDEN_ANGLE = 137.50776
STEPS = 12  # pieces of the curve of every stem, whatever the detail of its tube
UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Stems:
    """The stems of one level, sorted by parent and then by place on it.

    parent: (n,) int32 index into the level above, -1 at level 0. along: (n,) share of the
    parent's length at which it starts. length, radius: (n,) metres, radius at the base.
    points: (n, STEPS + 1, 3) metres, evenly spaced. side: (n, STEPS + 1, 3) unit, across the
    stem, level with the ground at the base. taper: 0 to 1.
    """

    parent: IntArray
    along: FloatArray
    length: FloatArray
    radius: FloatArray
    points: FloatArray
    side: FloatArray
    taper: float

    def __len__(self) -> int:
        return len(self.parent)

    def at(self, stem: IntArray, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Point, direction and side, each (m, 3), at the shares t (m,) of the stems' lengths."""
        place = np.clip(t, 0.0, 1.0) * STEPS
        step = np.minimum(place.astype(np.int64), STEPS - 1)
        rest = (place - step)[:, None]
        low, high = self.points[stem, step], self.points[stem, step + 1]
        direction = unit(high - low)
        side = self.side[stem, step] * (1 - rest) + self.side[stem, step + 1] * rest
        return low + rest * (high - low), direction, across(side, direction)

    def radius_at(self, stem: IntArray, t: FloatArray) -> FloatArray:
        """(m,) metres."""
        return np.asarray(self.radius[stem] * (1.0 - self.taper * np.clip(t, 0, 1)))


def across(vectors: FloatArray, directions: FloatArray) -> FloatArray:
    """The unit part of vectors (n, 3) at right angles to the unit directions (n, 3)."""
    dot = np.einsum("...i,...i->...", vectors, directions)[..., None]
    return unit(vectors - dot * directions)


def level_side(directions: FloatArray) -> FloatArray:
    """(n, 3) unit, at right angles to the directions and to the vertical where that is defined."""
    side = np.cross(directions, UP)
    steep = np.linalg.norm(side, axis=-1, keepdims=True) < 1e-3
    return across(np.where(steep, np.array([1.0, 0.0, 0.0]), side), directions)


def lay_out(
    count: int, weight: FloatArray, span: tuple[float, float], rng: np.random.Generator
) -> tuple[IntArray, FloatArray]:
    """Places for `count` children on parents laid end to end, each as long as its weight.

    Returns the parent (count,) and the place on it, a share of its length within `span` (count,).
    """
    ends = np.cumsum(weight)
    place = (np.arange(count) + rng.uniform(0.15, 0.85, count)) * (ends[-1] / max(count, 1))
    parent = np.minimum(np.searchsorted(ends, place, side="right"), len(weight) - 1)
    share = (place - (ends - weight)[parent]) / weight[parent]
    return parent.astype(np.int32), span[0] + np.clip(share, 0, 1) * (span[1] - span[0])


def aim(
    direction: FloatArray,
    side: FloatArray,
    share: FloatArray,
    down_angle: tuple[float, float],
    down_variation: float,
    rows: int,
    row_variation: float,
    rng: np.random.Generator,
) -> FloatArray:
    """(n, 3) unit directions in which children leave a parent of that direction and side.

    share: (n,) from the lowest to the highest place where children start, 0 to 1.
    """
    n = len(share)
    order = np.arange(n)
    if rows:
        turn = order % rows * (360.0 / rows) + rng.normal(0, row_variation, n)
    else:
        turn = order * GOLDEN_ANGLE + rng.normal(0, 10.0, n)
    turn = np.radians(turn)[:, None]
    down = (
        down_angle[0] + (down_angle[1] - down_angle[0]) * share + rng.normal(0, down_variation, n)
    )
    down = np.radians(down)[:, None]
    outward = np.cos(turn) * side + np.sin(turn) * np.cross(side, direction)
    return unit(np.cos(down) * direction + np.sin(down) * outward)


def above_ground(direction: FloatArray, point: FloatArray, step: FloatArray) -> FloatArray:
    """The directions (n, 3), less steep where a step (n,) from the points (n, 3) ends below it."""
    least = -np.clip(point[:, 1] / step, 0.0, 1.0)
    low = direction[:, 1] < least
    level = direction * np.array([1.0, 0.0, 1.0])
    shallow = unit(level) * np.sqrt(1 - least**2)[:, None] + least[:, None] * UP
    return unit(np.where(low[:, None], shallow, direction))


def envelope_at(envelope: tuple[float, ...], share: FloatArray) -> FloatArray:
    """The envelope, given at even steps, at shares 0 to 1 of the way."""
    return np.asarray(np.interp(share, np.linspace(0, 1, len(envelope)), envelope))


def first_stems(level: StemLevel, rng: np.random.Generator) -> Stems:
    """The trunks, which rise from the ground."""
    n = level.count
    turn = np.radians(np.arange(n) * GOLDEN_ANGLE + rng.uniform(0, 360))
    out = np.sqrt((np.arange(n) + 0.5) / n)
    outward = np.stack([np.cos(turn), np.zeros(n), np.sin(turn)], axis=1)
    lean = level.down_angle[0] + (level.down_angle[1] - level.down_angle[0]) * out
    lean = np.radians(lean + rng.normal(0, level.down_variation, n))[:, None]
    direction = unit(np.cos(lean) * UP + np.sin(lean) * outward)
    length = level.length * (1 + level.length_variation * rng.uniform(-1, 1, n))
    length *= envelope_at(level.envelope, out)
    radius = level.radius * (length / level.length)
    return _grow(
        level,
        np.full(n, -1, np.int32),
        np.zeros(n),
        level.spread * out[:, None] * outward,
        direction,
        length,
        radius,
        rng,
    )


def next_stems(level: StemLevel, parents: Stems, rng: np.random.Generator) -> Stems:
    """The children of `parents`."""
    parent, along = lay_out(level.count, parents.length, level.along, rng)
    origin, direction, side = parents.at(parent, along)
    low, high = level.along
    share = (along - low) / max(high - low, 1e-9)
    length = level.length * parents.length[parent] * envelope_at(level.envelope, share)
    length *= 1 + level.length_variation * rng.uniform(-1, 1, level.count)
    radius = level.radius * parents.radius_at(parent, along)
    heading = aim(
        direction,
        side,
        share,
        level.down_angle,
        level.down_variation,
        level.rows,
        level.row_variation,
        rng,
    )
    return _grow(level, parent, along, origin, heading, length, radius, rng)


def _grow(
    level: StemLevel,
    parent: IntArray,
    along: FloatArray,
    origin: FloatArray,
    direction: FloatArray,
    length: FloatArray,
    radius: FloatArray,
    rng: np.random.Generator,
) -> Stems:
    """Step along all stems of the level at once, bending each step a little."""
    n = len(parent)
    points = np.empty((n, STEPS + 1, 3))
    sides = np.empty((n, STEPS + 1, 3))
    side = level_side(direction)
    points[:, 0], sides[:, 0] = origin, side
    curve = np.radians(level.curve) / STEPS
    wander = np.radians(level.wander) / np.sqrt(STEPS)
    for step in range(STEPS):
        upward = np.cross(side, direction)
        bend = rng.normal(0, wander, (2, n, 1)) if step else np.zeros((2, n, 1))
        direction = unit(
            direction + (curve + bend[0]) * upward + bend[1] * side + (level.tropism / STEPS) * UP
        )
        direction = above_ground(direction, points[:, step], length / STEPS)
        side = across(side, direction)
        points[:, step + 1] = points[:, step] + direction * (length / STEPS)[:, None]
        sides[:, step + 1] = side
    return Stems(parent, along, length, radius, points, sides, level.taper)
