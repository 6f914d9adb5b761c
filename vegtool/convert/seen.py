"""Which levels of a chain an eye of a scene may see: of those that would be made for any eye.

A level is drawn from its switch distance until the next one has replaced it, at the end of that
one's fade. Those that are made for distances beyond the farthest eye are drawn nowhere; of those
that give way before the nearest eye comes, none are but the last, which is made for that eye then,
with as many billboards and texels as its size there asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from vegtool.limits import Limits, Omitted, Span, between
from vegtool.lod import Level
from vegtool.measure.distances import rounded_down

Wanted = tuple[int, float]
"""Billboards that a level may have, and metres from which it is for."""
Fewer = Callable[[int, float, float], int]
"""Of such a level, the number that it may have where it is for a distance farther away."""


def first_needed(wanted: Sequence[Wanted], span: Span) -> int:
    """Index of the last level that has replaced all before it where the nearest eye is, if it can
    be used from where it is made for; 0 where none has."""
    return max((index for index, (_, near) in enumerate(wanted) if span.replaced(near)), default=0)


def for_span(wanted: Sequence[Wanted], span: Span, fewer: Fewer) -> list[Wanted]:
    """The levels, the finest of them made for the nearest eye; without those
    that no eye is far enough away for."""
    first, found = first_needed(wanted, span), list[Wanted]()
    at_m = rounded_down(span.replaced_m)
    for index, (count, near) in enumerate(wanted):
        if not span.reached(near):
            break
        if index > first or near >= at_m:
            found.append((count, near))
        else:  # one before the first is there because that one errs too much: it has all of its own
            found.append((fewer(count, near, at_m) if index == first else count, at_m))
    return found


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
    wanted: Sequence[Wanted], first: int, last: int, original: Level, whole: bool, limits: Limits
) -> tuple[Omitted, ...]:
    """What a chain does without: of the levels `wanted` for any eye, those before `first` and from
    `last` on, and the original unless it is `whole`."""
    seen = f"plants are seen {between(limits.nearest_m, limits.farthest_m)}"
    found = list[Omitted]()
    if not whole:
        why = f"no eye is near enough: {seen}"
        found.append(Omitted("the original", why, triangles=original.triangles))
    parts = [(wanted[:first], "near"), (wanted[last:], "far")]
    for part, where in parts:
        for count, near in part:
            what = f"a level of up to {count:,} billboards for {near:g} m on"
            found.append(Omitted(what, f"no eye is {where} enough: {seen}"))
    return tuple(found)
