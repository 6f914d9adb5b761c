"""The control of the surfels' size on frames of any length and as late as they may be: it comes to
rest where frames take what they should, or at a limit, and turns once at most.

A frame of a simulated scene takes a + b s^-k of its target's time, s pixels being the size.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain, cycle, islice, pairwise, repeat
from math import inf, isfinite, nan

import numpy as np

from vegtool.preview.size_control import (
    DEAD_BAND,
    LARGEST_PX,
    LATE_FRAMES,
    MEDIAN_FRAMES,
    SMALLEST_PX,
    WEIGHT,
    SizeControl,
    step,
)
from vegtool.seeding import generator
from vegtool.stability.case import Case, Outcome, exact, holds, relative
from vegtool.stability.governor import TARGET_MS, Scene

TOPIC = "size control"
"""Heading of the cases in the table."""
FRAMES = 1200
"""Of a run: 170 steps, more than there can be, each of as many frames as are waited for."""
WITHIN = (DEAD_BAND[0] - 1e-9, DEAD_BAND[1] + 1e-9)
"""Of the target: what a scene's own time is held to, but for a rounding."""


def controlled(scene: Scene, state: SizeControl, frames: int = FRAMES) -> Iterator[SizeControl]:
    """The state after each of so many frames."""
    random = generator(0, "stability", "size control")
    times: list[float] = []
    for _ in range(frames):
        noise = 1 + scene.noise * random.uniform(-1, 1)
        times.append(state.target_ms * scene.cost(state.detail) * noise)
        state = step(state, times[max(len(times) - 1 - scene.late, 0)])
        yield state


def good(scene: Scene, size_px: float) -> bool:
    """Whether a size is one to stay at: frames take what they should, or nothing better is to be
    had."""
    cost = scene.cost(1 / size_px)
    least, most = WITHIN
    return least <= cost <= most or size_px == (SMALLEST_PX if cost < 1 else LARGEST_PX)


def comes_to_rest(scene: Scene, start_px: float) -> Outcome:
    """Nothing moves any more, to the bit, where frames take what they should; until then, the size
    turns once at most."""
    sizes = [start_px, *(s.size_px for s in controlled(scene, SizeControl(TARGET_MS, start_px)))]
    ways = [b > a for a, b in pairwise(sizes) if b != a]
    turns = sum(a != b for a, b in pairwise(ways))
    last = max((n for n in range(FRAMES) if sizes[n] != sizes[n + 1]), default=-1) + 1
    wrong = (turns > 1) + (not good(scene, sizes[-1])) + (last > FRAMES / 2)
    note = f"{sizes[-1]:.2f} px after {len(ways)} steps, {last} frames"
    return holds(wrong, "at rest where it should, with one turn at most", FRAMES, note)


def under_noise(scene: Scene) -> Outcome:
    """Times that leave the dead band by themselves. Where all that may be seen of a size is on one
    side of it, a step goes to the other side; of the rest, no step leads out."""
    low, high = DEAD_BAND[0] / (1 + scene.noise), DEAD_BAND[1] / (1 - scene.noise)
    states = list(controlled(scene, SizeControl(TARGET_MS, LARGEST_PX)))[FRAMES // 2 :]
    costs = [scene.cost(state.detail) for state in states]
    moves = sum(a.size_px != b.size_px for a, b in pairwise(states))
    return holds(
        sum(not low <= cost <= high for cost in costs), f"{low:.2f} to {high:.2f} targets",
        FRAMES, f"{min(costs):.3f} to {max(costs):.3f}; {moves} steps in {len(states)} frames",
    )  # fmt: skip


def a_jump(low: float, high: float) -> Outcome:
    """Time that jumps over the target at a size: no size is good, and none is far from that one."""
    edge, state, sizes = 3.0, SizeControl(TARGET_MS, LARGEST_PX), []
    for _ in range(FRAMES):
        state = step(state, TARGET_MS * (high if state.size_px < edge else low))
        sizes.append(state.size_px)
    late = np.array(sizes[FRAMES // 2 :])
    apart = (high - low) / (WEIGHT + 1)
    wrong = int((np.abs(late / edge - 1) > apart + 1e-9).sum())
    note = f"{late.min():.2f} to {late.max():.2f} px"
    return holds(wrong, f"within {apart:.1%}, a quarter of the jump", FRAMES, note)


def load_changes(factor: float) -> Outcome:
    """The viewer steps into a forest or out of it: at rest again where it should be."""
    scene = Scene(0.1, 6.0, 2.0)
    *_, before = controlled(scene, SizeControl(TARGET_MS))
    other = replace(scene, varying=factor * scene.varying)
    *_, after = controlled(other, before)
    wrong = (not good(scene, before.size_px)) + (not good(other, after.size_px))
    return holds(wrong, "at rest where it should", 2 * FRAMES,
                 f"{before.size_px:.2f} px, then {after.size_px:.2f} px")  # fmt: skip


def to_the_limit(frame_ms: Iterable[float], end: float) -> Outcome:
    """Frames that no size helps: the size goes to its limit, never turns back, and stays there."""
    state, sizes = SizeControl(TARGET_MS, 3.0), [3.0]
    for ms in islice(frame_ms, FRAMES):
        state = step(state, ms)
        sizes.append(state.size_px)
    wrong = int((np.diff(sizes) * (end - 3.0) < 0).sum()) + (set(sizes[FRAMES // 2 :]) != {end})
    return holds(wrong, "at the limit, by the shortest way", FRAMES)


def unmoved(frame_ms: Callable[[], Iterable[float]]) -> Outcome:
    """Frames that are on target but for some: the size stays, to the bit."""
    state = SizeControl(TARGET_MS, 3.0)
    for ms in chain(repeat(TARGET_MS, 10), islice(frame_ms(), FRAMES)):
        state = step(state, ms)
    return exact(abs(state.size_px - 3.0))


def no_windup(held: int) -> Outcome:
    """However long a limit was not enough, the size leaves it as soon as it is."""
    leaves = []
    for frames in (20, held):
        state = SizeControl(TARGET_MS, LARGEST_PX)
        for _ in range(frames):
            state = step(state, 10 * TARGET_MS)
        count = 0
        while state.size_px == LARGEST_PX and count < FRAMES:
            state, count = step(state, 0.5 * TARGET_MS), count + 1
        leaves.append(count)
    wrong = abs(leaves[0] - leaves[1]) + (leaves[1] > MEDIAN_FRAMES)
    return holds(wrong, "as many frames", leaves[1], f"{held} frames at the limit")


def no_numbers() -> Outcome:
    """Times that are none between those that are: the same as without them, to the bit."""
    random = generator(0, "stability", TOPIC, "none")
    plain = mixed = SizeControl(TARGET_MS)
    for ms in random.uniform(10, 60, 500).tolist():
        plain = step(plain, ms)
        for bad in (nan, -1.0, -inf):
            mixed = step(mixed, bad)
        mixed = step(mixed, ms)
    return exact(0.0 if plain == mixed else inf, note=f"{plain.size_px:.4f} px")


def anything_goes(seed: int) -> Outcome:
    """Frames of any length, or none: within the limits, and no step down of more than a quarter."""
    random = generator(seed, "stability", TOPIC, "any")
    odd = [0.0, nan, inf, -inf, -1.0, 5e-324, 1e308]
    state, wrong = SizeControl(TARGET_MS, 3.0), 0
    for _ in range(3000):
        after = step(state, float(random.choice([*10.0 ** random.uniform(-6, 9, 14), *odd])))
        wrong += not (isfinite(after.size_px) and SMALLEST_PX <= after.size_px <= LARGEST_PX)
        wrong += after.size_px < state.size_px * WEIGHT / (WEIGHT + 1) * (1 - 1e-12)
        state = after
    return holds(wrong, f"{SMALLEST_PX:g} to {LARGEST_PX:g} px, by a quarter at most", 3000)


def other_units(scale: float) -> Outcome:
    """Target and frames so many times as long: the same size."""
    random = generator(0, "stability", TOPIC, "units")
    here, there, error = SizeControl(TARGET_MS, 3.0), SizeControl(scale * TARGET_MS, 3.0), 0.0
    for ms in random.uniform(5, 40, 1000).tolist():
        here, there = step(here, ms), step(there, scale * ms)
        error = max(error, relative(there.size_px, here.size_px))
    return exact(error)


CASES = (
    *(
        Case(f"surfels from {start:g} px, power {power:g}", TOPIC, "property",
             partial(comes_to_rest, Scene(0.0, 3.0**power, power), start))
        for start in (SMALLEST_PX, LARGEST_PX)
        for power in (0.5, 1.0, 2.0, 3.0, 4.0)
    ),
    *(
        Case(f"surfels, times known {late} frames late, power {power:g}", TOPIC, "property",
             partial(comes_to_rest, Scene(0.0, 3.0**power, power, late=late), SMALLEST_PX))
        for late in range(1, LATE_FRAMES + 1)
        for power in (1.0, 2.0, 3.0, 4.0)
    ),
    *(
        Case(f"surfels, {fixed:g} of the target fixed", TOPIC, "property",
             partial(comes_to_rest, Scene(fixed, 4.0, 2.0, late=3), SMALLEST_PX))
        for fixed in (0.5, 0.85, 0.95, 1.2)
    ),
    *(
        Case(f"surfels, {start:g} targets at 1 px", TOPIC, "property",
             partial(comes_to_rest, Scene(0.0, start, 2.0, late=3), SMALLEST_PX))
        for start in (0.5, 1.05, 9.0, 40.0, 1e3)
    ),
    *(
        Case(f"surfels, times that vary by {noise:.0%}, {late} frames late", TOPIC, "property",
             partial(under_noise, Scene(0.0, 9.0, 2.0, late=late, noise=noise)))
        for noise in (0.05, 0.2)
        for late in (0, 3)
    ),
    *(
        Case(f"surfels, {low:g} targets from 3 px on, {high:g} below", TOPIC, "property",
             partial(a_jump, low, high))
        for low, high in ((0.8, 1.3), (0.2, 2.0))
    ),
    *(
        Case(f"surfels, {factor:g} times as many", TOPIC, "property",
             partial(load_changes, factor))
        for factor in (3.0, 1 / 3, 100.0, 0.01)
    ),
    *(
        Case(f"surfels, frames: {name}", TOPIC, "property", partial(to_the_limit, frames, end))
        for name, frames, end in (
            ("0 ms", repeat(0.0), SMALLEST_PX),
            ("1e9 ms", repeat(1e9), LARGEST_PX),
            ("infinite", repeat(inf), LARGEST_PX),
        )
    ),
    *(
        Case(f"surfels stay: {name}", TOPIC, "exact", partial(unmoved, frames))
        for name, frames in (
            ("1e9 ms now and then", lambda: cycle(chain([1e9], repeat(TARGET_MS, 9)))),
            ("infinite now and then", lambda: cycle(chain([inf], repeat(TARGET_MS, 9)))),
            ("0 ms now and then", lambda: cycle(chain([0.0], repeat(TARGET_MS, 9)))),
            ("at one edge of the dead band", lambda: repeat(1.0999 * TARGET_MS)),
            ("at the other", lambda: repeat(0.9001 * TARGET_MS)),
        )
    ),
    Case("surfels, no wind-up", TOPIC, "property", partial(no_windup, 20_000)),
    Case("surfels, times that are no numbers", TOPIC, "exact", no_numbers),
    *(
        Case(f"surfels, frames of any length, {seed}", TOPIC, "property",
             partial(anything_goes, seed))
        for seed in (0, 1)
    ),
    *(
        Case(f"surfels, times in units of {scale:g}", TOPIC, "equivariance",
             partial(other_units, scale))
        for scale in (1e-6, 1e6)
    ),
)  # fmt: skip
