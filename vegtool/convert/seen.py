"""Which levels of a chain an eye of a scene may see: of those that would be made for any eye.

A level is drawn from its switch distance until the next one has replaced it, at the end of that
one's fade. Those that are made for distances beyond the farthest eye are drawn nowhere; of those
that give way before the nearest eye comes, none are but the last, which is made for that eye then,
with as many billboards and texels as its size there asks for, or as it takes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from vegtool.convert.options import LEVEL_RATIO
from vegtool.limits import Limits, Omitted, Span, between
from vegtool.lod import Level
from vegtool.measure.distances import rounded_down

Wanted = tuple[int, float]
"""Billboards that a level may have, and metres from which it is for."""
Fewer = Callable[[int, float, float], int]
"""Of such a level, the number that it may have where it is for a distance farther away."""


def tries(wanted: Sequence[Wanted], span: Span, fewer: Fewer) -> Iterator[list[Wanted]]:
    """Chains to try, of levels `wanted` for any eye, each dearer than the one before.

    Each begins with a level that is for the nearest eye alone, and stands for all that give way
    before it comes: if that one errs too much there, with twice as many billboards. The last has
    all levels, for who keeps the original beside them, none for nearer than the nearest eye.
    """
    reached = [one for one in wanted if span.reached(one[1])]
    at_m = rounded_down(span.replaced_m)
    before = [one for one in reached if span.replaced(one[1])]
    if before:
        count, near = before[-1]
        count, most = fewer(count, near, at_m), max(count for count, _ in before)
        at_m = max(at_m, near)
        yield [(count, at_m), *reached[len(before) :]]
        while count < most:
            count = min(LEVEL_RATIO * count, most)
            yield [(count, at_m), *reached[len(before) :]]
    yield [(count, max(near, at_m)) for count, near in reached]


def drawn(levels: Sequence[Level], span: Span) -> tuple[Level, ...]:
    """Those of the levels, with distances from which they may be used, that some eye sees."""
    return tuple(
        level
        for index, level in enumerate(levels)
        if span.reached(level.near_distance_m)
        and not any(span.replaced(after.near_distance_m) for after in levels[index + 1 :])
    )


def complete(levels: Sequence[Level], span: Span) -> bool:
    """Whether these levels are enough without a finer one."""
    return bool(levels) and span.replaced(levels[0].near_distance_m)


def beginning(levels: Sequence[Level]) -> tuple[Level, ...]:
    """The same, of which the first is drawn from everywhere."""
    return replace(levels[0], near_distance_m=0.0), *levels[1:]


def omitted(
    wanted: Sequence[Wanted], made: Sequence[Wanted], original: Level, whole: bool, limits: Limits
) -> tuple[Omitted, ...]:
    """What a chain does without: of the levels `wanted` for any eye, those that none of `made` is,
    and the original unless it is `whole`."""
    seen = f"plants are seen {between(limits.nearest_m, limits.farthest_m)}"
    found = list[Omitted]()
    if not whole:
        why = f"no eye is near enough: {seen}"
        found.append(Omitted("the original", why, triangles=original.triangles))
    first_m = min((near for _, near in made), default=0.0)
    missing = [one for one in wanted if one not in made]
    nearer = [one for one in missing if one[1] <= first_m]
    for count, near in missing:
        why = f"no eye is {'near' if (count, near) in nearer else 'far'} enough: {seen}"
        if nearer and (count, near) == nearer[-1] and made[0] not in wanted:
            why = f"one of up to {made[0][0]:,} for {made[0][1]:g} m on is in its place: {seen}"
        found.append(Omitted(f"a level of up to {count:,} billboards for {near:g} m on", why))
    return tuple(found)
