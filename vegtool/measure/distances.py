"""From which distance each level of a chain may be used, by what was measured of them.

A level's distance is the least from which its error stays within the limit for as long as the level
is shown: until the next coarser level has taken over, fading included. So the coarsest level is
settled first, and each finer one is asked only for what the coarser ones leave to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum
from math import exp, floor, inf, log, log10, sqrt

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.lod import FADE_FRACTION

FLOOR = 0.1
"""FLIP. Where the live original errs less, a level need not: docs/methods/switch_distances.md."""
DIGITS = 3
"""Of a stated distance; the others are rounded away, upwards."""


class LeftOut(Enum):
    """Why a level has no distance."""

    ERRS = "its error is above the limit where it would be used"
    SUPERSEDED = "a coarser level may be used from as near"


def limits(live: FloatArray, max_error: float | None = None) -> FloatArray:
    """(d,) the error allowed at each distance, for the live original's own, (d,), mean FLIP."""
    if max_error is not None:
        return np.full_like(live, max_error)
    return np.maximum(live, FLOOR)


def switch_distances(
    distance_m: FloatArray,
    errors: Sequence[FloatArray],
    limit: FloatArray,
    least_m: Sequence[float] | None = None,
    holds: Callable[[int, float], bool] = lambda level, distance: True,
    farthest_m: float = inf,
) -> tuple[float | LeftOut, ...]:
    """The distance, metres, from which each level may be used, or why it has none.

    distance_m: (d,) increasing, where was measured. errors: per level, finest first, (d,). limit:
    (d,). least_m: metres per level below which it is not used, whatever its error. holds: whether
    a level keeps to the limit at a distance between those measured; where it does not, one halfway
    to the next measured is asked for, and then that one taken. farthest_m: beyond, no level is
    shown, and none needs to keep to a limit.

    Between measured distances, errors and limits are taken to be linear in the logarithm of
    distance. The last distance stands for all beyond. Distances are rounded up to three digits,
    and increase by more than a fade from each level to the next.
    """
    found: list[float | LeftOut] = []
    until, next_m = max(float(distance_m[0]), min(float(distance_m[-1]), farthest_m)), np.inf
    for level in reversed(range(len(errors))):
        start = _start(distance_m, errors[level] - limit, until)
        if start is None:
            found.append(LeftOut.ERRS)
            continue
        least = 0.0 if least_m is None else rounded_up(least_m[level])
        from_m, behind_m = (max(rounded_up(m), least) for m in start)
        halfway_m = rounded_up(sqrt(from_m * behind_m))
        last = next_m / (1 + FADE_FRACTION)
        tried = (from_m, halfway_m, behind_m)
        from_m = next(m for m in tried if m >= behind_m or m > last or holds(level, m))
        if from_m > last:
            found.append(LeftOut.SUPERSEDED)
            continue
        found.append(from_m)
        until, next_m = min((1 + FADE_FRACTION) * from_m, until), from_m
    return tuple(reversed(found))


def _start(distance_m: FloatArray, excess: FloatArray, until: float) -> tuple[float, float] | None:
    """Least distance from which the excess stays at most 0 as far as `until`; the one measured
    next after it. None where it is above 0 there."""
    steps = np.log(distance_m)
    end = log(until)
    if np.interp(end, steps, excess) > 0:
        return None
    last = int(np.searchsorted(steps, end, side="left"))  # the first measured beyond, or there
    above = np.flatnonzero(excess[:last] > 0)
    if not len(above):
        return float(distance_m[0]), float(distance_m[0])
    i = int(above[-1])
    behind = float(distance_m[i + 1]) if i + 1 < last else until
    share = excess[i] / (excess[i] - excess[i + 1])
    return exp(steps[i] + share * (steps[i + 1] - steps[i])), behind


def rounded_up(metres: float) -> float:
    """To three digits; 0 stays."""
    if metres <= 0:
        return 0.0
    places = DIGITS - 1 - floor(log10(metres))
    scaled = metres * 10.0**places
    nearest = round(scaled)
    whole = nearest if abs(scaled - nearest) < 1e-9 * scaled else floor(scaled) + 1
    return float(round(whole / 10.0**places, max(places, 0)))


def rounded_down(metres: float) -> float:
    """To three digits; 0 stays."""
    if metres <= 0:
        return 0.0
    places = DIGITS - 1 - floor(log10(metres))
    return float(round(floor(metres * 10.0**places) / 10.0**places, max(places, 0)))
