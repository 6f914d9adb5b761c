"""The frame time's governor on plants that are not what it takes them for, and on frames of any
length: it comes to its target and stays there, or goes to a limit, and never to and fro.

A frame of a simulated scene takes a + b detail^k of its target's time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, cycle, islice, repeat
from math import inf, isfinite, log, nan

import numpy as np

from vegtool.preview.governor import BEGIN, LONGEST_STEP_S, RATE_PER_S, Governor, step
from vegtool.seeding import generator
from vegtool.stability.case import Case, Outcome, exact, holds, relative

TARGET_MS = 1000 / 60
"""What most frames here should take."""
SETTLED_S = 6.0
"""Seconds after which the target is kept to."""
OVERSHOOT = 0.01
"""Of the target: most that frames may go beyond it on their way; under noise, as much as BEGIN."""


@dataclass(frozen=True)
class Scene:
    """What frames take. fixed, varying: a and b, in targets. power: k. late: frames until a time is
    known. noise: largest part of a frame's time that is added or taken away."""

    fixed: float
    varying: float
    power: float
    late: int = 0
    noise: float = 0.0

    def cost(self, detail: float) -> float:
        """Targets that a frame takes."""
        return float(self.fixed + self.varying * detail**self.power)


@dataclass(frozen=True)
class Frame:
    """What came of a frame: seconds at its end, the state after it, and what the next one takes at
    that detail, in targets, without noise."""

    seconds: float
    state: Governor
    cost: float


def governed(
    scene: Scene, state: Governor, seconds: float, screen_s: float = 0.0
) -> Iterator[Frame]:
    """Frames of so many seconds, drawn one after the other. screen_s: time between two refreshes of
    a screen that pictures wait for; 0 for none."""
    random = generator(0, "stability", "governor")
    times: list[float] = []
    passed = 0.0
    while passed < seconds:
        noise = 1 + scene.noise * random.uniform(-1, 1)
        times.append(state.target_ms * scene.cost(state.detail) * noise)
        lasts = times[-1] / 1000
        if screen_s:
            lasts = screen_s * np.ceil(lasts / screen_s)
        state = step(state, times[max(len(times) - 1 - scene.late, 0)], lasts)
        passed += lasts
        yield Frame(passed, state, scene.cost(state.detail))


def settles(scene: Scene, detail: float, target_ms: float = TARGET_MS) -> Outcome:
    """The target is kept to after some seconds, within what is not corrected; until then, frames
    come nearer to it and not beyond. Then nothing moves, or under noise less and less often."""
    state = Governor(target_ms, detail=detail, most=4.0)
    frames = list(governed(scene, state, 3 * SETTLED_S))
    side = 1.0 if scene.cost(detail) > 1 else -1.0
    beyond = max(0.0, *(-side * (frame.cost - 1) for frame in frames))
    late = [frame for frame in frames if frame.seconds > SETTLED_S]
    off = max(abs(frame.cost - 1) for frame in late)
    details = [frame.state.detail for frame in late]
    wrong = (beyond > (BEGIN if scene.noise else OVERSHOOT)) + (off > BEGIN)
    wrong += not scene.noise and details[len(details) // 2] != details[-1]
    within = next(
        a.seconds for a in frames
        if all(abs(b.cost - 1) <= BEGIN for b in frames if b.seconds >= a.seconds)
    )  # fmt: skip
    note = f"within {BEGIN:.0%} after {within:.1f} s, beyond it by {beyond:.1%}"
    return holds(wrong, f"within {BEGIN:.0%} from {SETTLED_S:g} s on", len(frames), note)


def known_detail(power: float) -> Outcome:
    """Where frames end, detail is the root of the scene's power law, within the last error's."""
    scene = Scene(0.25, 1.5, power)
    *_, last = governed(scene, Governor(TARGET_MS, detail=1.0), 3 * SETTLED_S)
    root = (0.75 / 1.5) ** (1 / power)
    allowed = BEGIN / (0.75 * power)  # the scene's cost changes by that power, less its fixed part
    return Outcome(relative(last.state.detail, root), allowed, "an error that is not corrected")


def load_changes(factor: float) -> Outcome:
    """The viewer steps into a forest or out of it: the same frames as for one who begins there."""
    scene = Scene(0.1, 1.2, 2.0)
    *_, before = governed(scene, Governor(TARGET_MS, most=4.0), 2 * SETTLED_S)
    other = replace(scene, varying=factor * scene.varying)
    late = [f for f in governed(other, before.state, 2 * SETTLED_S) if f.seconds > SETTLED_S]
    return holds(sum(abs(f.cost - 1) > BEGIN for f in late), f"within {BEGIN:.0%} again")


def waits_for_the_screen(hertz: float) -> Outcome:
    """Pictures that wait for a screen: what drawing takes is governed, however long they wait."""
    scene = Scene(0.2, 1.5, 2.0)
    frames = governed(scene, Governor(TARGET_MS, most=4.0), 2 * SETTLED_S, 1 / hertz)
    late = [f for f in frames if f.seconds > SETTLED_S]
    return holds(sum(abs(f.cost - 1) > BEGIN for f in late), f"within {BEGIN:.0%}")


def to_the_limit(frame_ms: Iterable[float], end: float) -> Outcome:
    """Frames that no detail helps: detail goes to its limit, never turns back, and stays there."""
    state, details = Governor(TARGET_MS, detail=0.5), [0.5]
    for ms in islice(frame_ms, 4000):
        state = step(state, ms, max(ms / 1000, 0.01) if isfinite(ms) else 1.0)
        details.append(state.detail)
    ways = np.sign(np.diff(details))
    wrong = int((ways * (end - 0.5) < 0).sum()) + (details[-1] != end) + (details[2000] != end)
    return holds(wrong, "at the limit, by the shortest way")


def unmoved(frame_ms: Callable[[], Iterable[float]]) -> Outcome:
    """Frames that are on target but for some, or on average: detail stays, to the bit."""
    state = Governor(TARGET_MS, detail=0.5)
    for ms in chain(repeat(TARGET_MS, 50), islice(frame_ms(), 4000)):
        state = step(state, ms)
    return exact(abs(state.detail - 0.5), note=f"average {state.average_ms:.3g} ms")


def no_windup(held: int) -> Outcome:
    """However long a limit was not enough, detail leaves it as soon as it is."""
    leaves = []
    for frames in (100, held):
        state = Governor(TARGET_MS, detail=0.3)
        for _ in range(frames):
            state = step(state, 10 * TARGET_MS, 0.1)
        count = 0
        while state.detail == state.least and count < 1000:
            state, count = step(state, 0.5 * TARGET_MS), count + 1
        leaves.append(count)
    return holds(
        abs(leaves[0] - leaves[1]) + (leaves[1] == 1000), "as many frames", leaves[1],
        f"{held} frames at the limit",
    )  # fmt: skip


def no_numbers() -> Outcome:
    """Times that are none between those that are: the same as without them, to the bit."""
    random = generator(0, "stability", "governor", "none")
    plain = mixed = Governor(TARGET_MS)
    for ms in random.uniform(10, 60, 500).tolist():
        plain = step(plain, ms)
        for bad in (nan, -1.0, -inf):
            mixed = step(mixed, bad)
        mixed = step(mixed, ms)
    return exact(0.0 if plain == mixed else inf, note=f"detail {plain.detail:.4f}")


def anything_goes(seed: int) -> Outcome:
    """Frames and times between them of any length, or none: within the limits, and no faster than
    distances may move."""
    random = generator(seed, "stability", "governor", "any")
    odd = [0.0, nan, inf, -inf, -1.0, 5e-324, 1e308]
    state, wrong = Governor(TARGET_MS, 0.25, 4.0, 1.0), 0
    for _ in range(3000):
        values = np.concatenate([10.0 ** random.uniform(-6, 9, 4), odd])
        ms, seconds = (float(v) for v in random.choice(values, 2))
        after = step(state, ms, seconds)
        passed = min(max(seconds, 0.0), LONGEST_STEP_S) if seconds == seconds else 0.0
        moved = abs(log(after.detail / state.detail))
        wrong += not (isfinite(after.detail) and 0.25 <= after.detail <= 4)
        wrong += moved > RATE_PER_S * passed * (1 + 1e-9) + 1e-12
        wrong += after.average_ms is not None and not 0 <= after.average_ms < inf
        state = after
    return holds(wrong, f"by at most {RATE_PER_S:.0%} a second", 3000)


def other_units(scale: float) -> Outcome:
    """Target and frames so many times as long: the same detail, as time between frames is not."""
    random = generator(0, "stability", "governor", "units")
    here, there = Governor(TARGET_MS), Governor(scale * TARGET_MS)
    error = 0.0
    for ms in random.uniform(5, 60, 1000).tolist():
        here, there = step(here, ms, 1 / 60), step(there, scale * ms, 1 / 60)
        error = max(error, relative(there.detail, here.detail))
    return exact(error)


def fixed_detail() -> Outcome:
    """Limits that leave no choice: nothing changes."""
    state = Governor(TARGET_MS, 0.5, 0.5, 0.5)
    for ms in (1.0, 1e9) * 100:
        state = step(state, ms)
    return exact(abs(state.detail - 0.5))


CASES = (
    *(
        Case(f"frames from {start:g} times the target, power {power:g}", "governor", "property",
             partial(settles, Scene(0.0, start, power), 1.0))
        for start in (2.0, 0.5)
        for power in (0.5, 1.0, 2.0, 3.0)
    ),
    Case("frames from 10 times the target, power 2", "governor", "property",
         partial(settles, Scene(0.0, 10.0, 2.0), 1.0)),
    Case("half the target is fixed, power 2", "governor", "property",
         partial(settles, Scene(0.5, 1.5, 2.0), 1.0)),
    Case("times known 3 frames late, power 3", "governor", "property",
         partial(settles, Scene(0.0, 2.0, 3.0, late=3), 1.0)),
    *(
        Case(f"frames that vary by 20 %, power {power:g}", "governor", "property",
             partial(settles, Scene(0.0, 2.0, power, late=1, noise=0.2), 1.0))
        for power in (1.0, 2.0, 3.0)
    ),
    *(
        Case(f"target of {target:g} ms", "governor", "property",
             partial(settles, Scene(0.2, 1.8, 2.0), 1.0, target))
        for target in (1.0, 50.0)
    ),
    *(
        Case(f"detail that is known, power {power:g}", "governor", "exact",
             partial(known_detail, power))
        for power in (1.0, 2.0, 3.0)
    ),
    *(
        Case(f"load {factor:g} times as great", "governor", "property",
             partial(load_changes, factor))
        for factor in (3.0, 1 / 3)
    ),
    Case("pictures that wait for a screen", "governor", "property",
         partial(waits_for_the_screen, 60.0)),
    *(
        Case(f"frames: {name}", "governor", "property", partial(to_the_limit, frames, end))
        for name, frames, end in (
            ("0 ms", repeat(0.0), 1.0),
            ("1e9 ms", repeat(1e9), 0.25),
            ("infinite", repeat(inf), 0.25),
            ("1 and 1000 ms in turn", (1.0, 1000.0) * 2000, 0.25),
        )
    ),
    *(
        Case(f"detail stays: {name}", "governor", "exact", partial(unmoved, frames))
        for name, frames in (
            ("1e9 ms now and then", lambda: cycle(chain([1e9], repeat(TARGET_MS, 59)))),
            ("two infinite ones now and then",
             lambda: cycle(chain([inf, inf], repeat(TARGET_MS, 59)))),
            ("0 ms now and then", lambda: cycle(chain([0.0], repeat(TARGET_MS, 59)))),
            ("half and one and a half targets in turn",
             lambda: cycle([TARGET_MS / 2, 1.5 * TARGET_MS])),
            ("at the edge of what is corrected", lambda: repeat(1.0999 * TARGET_MS)),
        )
    ),
    Case("no wind-up", "governor", "property", partial(no_windup, 20_000)),
    Case("times that are no numbers", "governor", "exact", no_numbers),
    *(
        Case(f"frames of any length, {seed}", "governor", "property", partial(anything_goes, seed))
        for seed in (0, 1)
    ),
    *(
        Case(f"times in units of {scale:g}", "governor", "equivariance",
             partial(other_units, scale))
        for scale in (1e-6, 1e6)
    ),
    Case("limits that leave no choice", "governor", "exact", fixed_detail),
)  # fmt: skip
