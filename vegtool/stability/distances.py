"""Distances from which levels may be used: found under steps, noise and errors without measure."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.lod import FADE_FRACTION, Display, Level
from vegtool.measure.bounds import displacement_bound, distance_for_pixels, projection_bound
from vegtool.measure.distances import LeftOut, switch_distances
from vegtool.seeding import generator
from vegtool.stability.baking import clouds, moved
from vegtool.stability.cameras import UPRIGHT_MOTIONS, moved_camera, plate, view_of_tree
from vegtool.stability.case import Case, Outcome, exact, holds, relative, same_objective
from vegtool.stability.plants import Motion, soup

MEASURED: FloatArray = 10.0 * 2.0 ** np.arange(9.0)
"""(d,) metres: where errors are known."""
LIMIT = np.full(len(MEASURED), 0.2)
"""(d,) the error allowed."""


def falling(crosses_m: float, steepness: float) -> FloatArray:
    """(d,) errors that fall to the limit at `crosses_m`, linear in the logarithm of distance."""
    return np.asarray(LIMIT + steepness * np.log(crosses_m / MEASURED))


def known_crossing(crosses_m: float, steepness: float, scale: float) -> Outcome:
    """Errors that fall to the limit at a known distance of three digits: that is found."""
    crossing = falling(crosses_m, steepness)
    (found,) = switch_distances(scale * MEASURED, [crossing], LIMIT)
    if isinstance(found, LeftOut):
        return exact(np.inf, note=found.value)
    return exact(relative(found, scale * crosses_m))


NOISE = generator(0, "stability", "errors").normal(0, 0.05, (3, len(MEASURED)))
STEP = np.where(MEASURED < 100, 1.0, 0.0)
ERRORS: dict[str, FloatArray] = {
    "steps": np.stack([STEP, np.roll(STEP, 2), np.roll(STEP, 4)]),
    "noise": np.stack([falling(d, 0.1) for d in (30.0, 90.0, 400.0)]) + NOISE,
    "up and down": np.tile(0.2 + 0.1 * (-1.0) ** np.arange(len(MEASURED)), (3, 1)),
    "at the limit everywhere": np.tile(LIMIT, (3, 1)),
    "nowhere": np.ones((3, len(MEASURED))),
    "everywhere": np.zeros((3, len(MEASURED))),
    "a slope of 1e9": np.stack([falling(d, 1e9) for d in (30.0, 90.0, 400.0)]),
    "a slope of 1e-9": np.stack([falling(d, 1e-9) for d in (30.0, 90.0, 400.0)]),
}
"""Name -> (levels, d) errors."""


def any_errors(errors: FloatArray) -> Outcome:
    """Kept levels keep to the limit wherever they are shown; each takes over beyond the last."""
    found = switch_distances(MEASURED, list(errors), LIMIT)
    wrong, until = 0, float(MEASURED[-1])
    for level in reversed(range(len(errors))):
        start = found[level]
        if isinstance(start, LeftOut):
            continue
        at = np.unique([start, *MEASURED[(start <= MEASURED) & (until >= MEASURED)]])
        excess = np.interp(np.log(at), np.log(MEASURED), errors[level] - LIMIT)
        wrong += int((excess > 1e-9 * (1 + np.abs(errors[level]).max())).sum())
        until = min(until, (1 + FADE_FRACTION) * start)
    starts = [start for start in found if not isinstance(start, LeftOut)]
    wrong += sum(b <= a * (1 + FADE_FRACTION) for a, b in pairwise(starts))
    note = ", ".join("out" if isinstance(f, LeftOut) else f"{f:g} m" for f in found)
    return holds(wrong, "within the limit, farther and farther", note=note)


def bounds_move(motion: Motion) -> Outcome:
    """Most that billboards displace anything, from any direction and in one view, elsewhere."""
    display, here = Display(), clouds()[1]
    values = []
    for billboards, seen in ((here, view_of_tree()), (moved(here, motion), moved_camera(motion))):
        anywhere = displacement_bound(billboards, seen.target, seen.distance_m, display)
        values.append(np.stack([anywhere, projection_bound(billboards, seen)]))
    error = float(np.abs(values[1] / values[0] - 1).max())
    return same_objective(error, motion.offset / float(here.half_size.min()))


def known_distance(pixels: float, scale: float) -> Outcome:
    """From where a mesh that is off by e may be used to p pixels: r + e f / p metres from its
    middle, as long as that is more than twice r. r is its reach, f a metre's pixels at a metre."""
    plant = soup(scale * plate(1.0))
    off = 0.01 * scale
    level = Level("mesh", mesh=plant, geometric_error_m=(off, off))
    display = Display()
    found = distance_for_pixels(level, np.zeros(3), display, pixels)
    reach = 2**0.5 * scale + off
    return exact(relative(found, reach + off * display.pixels_per_metre(1.0) / pixels))


CASES = (
    *(
        Case(f"crossing at {metres:g} m, slope {steep:g}, {scale:g} times the size", "distances",
             "exact", partial(known_crossing, metres, steep, scale))
        for metres, steep in ((123.0, 0.1), (123.0, 1e6), (20.0, 0.1))
        for scale in (1e-6, 1.0, 1e6)
    ),
    *(
        Case(f"errors: {name}", "distances", "property", partial(any_errors, errors))
        for name, errors in ERRORS.items()
    ),
    *(
        Case(f"distance for {pixels:g} pixels, {scale:g} times the size", "distances", "exact",
             partial(known_distance, pixels, scale))
        for pixels in (1e-3, 1.0)
        for scale in (1e-6, 1.0, 1e6)
    ),
    *(
        Case(f"bounds of a tree's billboards, {motion.name}", "distances", "equivariance",
             partial(bounds_move, motion), gl=True)
        for motion in UPRIGHT_MOTIONS
    ),
)  # fmt: skip
