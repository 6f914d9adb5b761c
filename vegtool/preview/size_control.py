"""Keeps frames at the time that they should take, by the size of surfels.

Brandt et al.: Rendering of complex heterogenous scenes using progressive blue surfels (2019),
section 4.3: s_new = (3 s + s t / t_target) / 4, left alone while t / t_target is 0.9 to 1.1, and no
less than 1 pixel nor more than 8. Where times are those of the size that they are taken for:

- It comes to rest. Frames take a + b s^-k of their target, k 2 for points, and less where much is
  fixed. By the inequality of means (3 + e) / 4 is at least e^(1/4): up to k = 4 a size that falls
  never falls below the one that is wanted, so it turns once at most, after a step up that went too
  far (k 2: from more than 9 targets). A step is 2.5 % at least: there are 170 at most, but mostly
  fewer than ten.
- It is at a limit where no size would do: at 8 where more than 1.1 targets do not go by the size,
  at 1 where there is time left. It is its own integral, and leaves a limit at the first step.

Times that are late are those of a size before. Near the target an error e becomes e - (k / 4) e',
e' being the one of d frames before: stable for k / 4 < 2 sin(pi / (4 d + 2)). So points, k 2,
settle up to d = 2, ringing, and swing for ever from d = 3 on, where only a nineteenth of the error,
not a quarter, could be taken without ringing. Instead, frames that may still be those of the size
before are not counted (LATE_FRAMES), and the step stays the paper's. Its frame is the median of
MEDIAN_FRAMES: one that takes long by itself would send all surfels to 8 pixels, and back.

What does not come to rest: times whose median leaves 0.9 to 1.1 again and again, which move the
size by a quarter of what it is off; and a scene whose time jumps across 0.9 to 1.1 at some size,
about which it goes to and fro by a quarter of the jump.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from statistics import median

from vegtool.preview.governor import BEGIN

SMALLEST_PX, LARGEST_PX = 1.0, 8.0
"""Limits of the size."""
WEIGHT = 3.0
"""Of the size as it is, beside the one that the frame asks for."""
DEAD_BAND = (1 - BEGIN, 1 + BEGIN)
"""Of the target: frames between are left as they are; as the governor's and the paper's."""
LATE_FRAMES = 3
"""Frames after a change that are not counted: a GPU's clock is as late."""
MEDIAN_FRAMES = 3
"""Frames whose median counts: one that takes long is of no effect."""


@dataclass(frozen=True)
class SizeControl:
    """The size, and what it goes by.

    target_ms: what a frame should take; more than 0. size_px: diameter of surfels, 1 to 8. late:
    frames to come that are not counted. recent_ms: the last frames' times at this size.
    Raises ValueError for anything else.
    """

    target_ms: float
    size_px: float = SMALLEST_PX
    late: int = LATE_FRAMES
    recent_ms: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.target_ms < inf:
            raise ValueError(f"SizeControl.target_ms: expected more than 0; got {self.target_ms}")
        if not SMALLEST_PX <= self.size_px <= LARGEST_PX:
            raise ValueError(
                f"SizeControl.size_px: expected {SMALLEST_PX:g} to {LARGEST_PX:g}; got "
                f"{self.size_px}"
            )

    @property
    def detail(self) -> float:
        """The factor on all switch distances: surfels twice as large do from half the distance."""
        return 1 / self.size_px

    @property
    def resting(self) -> bool:
        """Whether frames at this size were enough to know that it may stay."""
        return len(self.recent_ms) == MEDIAN_FRAMES


def step(state: SizeControl, frame_ms: float) -> SizeControl:
    """The state after a frame.

    frame_ms: what drawing it took; one that is negative or no number is of no effect.
    """
    if not frame_ms >= 0:
        return state
    if state.late > 0:
        return replace(state, late=state.late - 1)
    state = replace(state, recent_ms=(*state.recent_ms, frame_ms)[-MEDIAN_FRAMES:])
    if not state.resting:
        return state
    deviation = median(state.recent_ms) / state.target_ms
    least, most = DEAD_BAND
    if least <= deviation <= most:
        return state
    wanted = state.size_px * (WEIGHT + deviation) / (WEIGHT + 1)
    size_px = min(max(wanted, SMALLEST_PX), LARGEST_PX)
    return state if size_px == state.size_px else SizeControl(state.target_ms, size_px)
