"""Keeps frames at the time that they should take, by a factor on all switch distances.

What a frame takes grows with that factor, `detail`, by some power: 2 where plants stand evenly on
the ground, for as many are nearer than a distance as its square says. The factor's logarithm is
the integral of the frames' error, which is a controller of first order: it comes to the target
without overshoot as long as what it knows of frames is not much older than they are. So frames are
used as they come, less outliers by a median; their moving average only decides when to act at all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import exp, inf
from statistics import fmean, median

LEAST = 0.25
"""Least detail where nobody asks for another one."""
SLOPE = 2.0
"""Power of detail that a frame's time is taken to grow with. Where it is another one, it takes
SLOPE over that many times as long to reach the target."""
RESPONSE_FRAMES = 24.0
"""Frames in which an error falls to 1 / e where the power is SLOPE. What overshoots is a greater
delay: of powers up to 3, more than RESPONSE_FRAMES SLOPE / 3 e, six frames; a median of five is
two late, and a GPU's clock three."""
MEDIAN_FRAMES = 5
"""Frames whose median counts: two in a row that take long are of no effect."""
AVERAGE_FRAMES = 16.0
"""Time constant of the moving average."""
BEGIN = 0.10
"""Of the target: an average that is off by more is corrected."""
END = 0.02
"""Of the target: until it is off by less. What is between the two is left as it is, so that nothing
moves for ever."""
WORST = 4.0
"""Targets that a frame is taken to last at most."""
RATE_PER_S = 0.5
"""Most that the logarithm of detail changes in a second: distances that move farther at a time are
seen to move."""
LONGEST_STEP_S = 0.1
"""A frame that takes longer lets distances move as after this."""


@dataclass(frozen=True)
class Governor:
    """The factor, and what it goes by.

    target_ms: what a frame should take; more than 0. least, most: limits of detail. detail: the
    factor on all switch distances. average_ms: of frames' times, without outliers and none longer
    than WORST targets; None until there are enough. recent_ms: the last frames' times, as they
    count. correcting: whether detail is on its way.
    Raises ValueError for limits that are none.
    """

    target_ms: float
    least: float = LEAST
    most: float = 1.0
    detail: float = 1.0
    average_ms: float | None = None
    recent_ms: tuple[float, ...] = ()
    correcting: bool = False

    def __post_init__(self) -> None:
        if not 0 < self.target_ms < inf:
            raise ValueError(f"Governor.target_ms: expected more than 0; got {self.target_ms}")
        if not 0 < self.least <= self.detail <= self.most < inf:
            raise ValueError(
                "Governor: expected 0 < least <= detail <= most; got "
                f"{self.least}, {self.detail}, {self.most}"
            )


def step(state: Governor, frame_ms: float, seconds: float | None = None) -> Governor:
    """The state after a frame.

    frame_ms: what drawing it took, which is less than the time between two pictures where these
    wait for the screen; one that is negative or no number is of no effect. seconds: since the frame
    before, where that is another time.
    """
    if not frame_ms >= 0:
        return state
    longest = WORST * state.target_ms
    recent = (*state.recent_ms, min(frame_ms, longest))[-MEDIAN_FRAMES:]
    state = replace(state, recent_ms=recent)
    if len(recent) < MEDIAN_FRAMES:
        return state
    usual_ms = median(recent)
    average = fmean(recent) if state.average_ms is None else state.average_ms
    average += (usual_ms - average) * (1 - exp(-1 / AVERAGE_FRAMES))
    error, lasting = usual_ms / state.target_ms - 1, average / state.target_ms - 1
    correcting = abs(lasting) > (END if state.correcting else BEGIN)
    state = replace(state, average_ms=average, correcting=correcting)
    # frames that are now too long and now too short move nothing to and fro
    if not correcting or error * lasting <= 0:
        return state
    passed = frame_ms / 1000 if seconds is None else seconds
    allowed = RATE_PER_S * (min(passed, LONGEST_STEP_S) if passed > 0 else 0.0)
    change = min(max(-error / (SLOPE * RESPONSE_FRAMES), -allowed), allowed)
    # the factor is the integral itself, so that nothing piles up at the limits
    return replace(state, detail=min(max(state.detail * exp(change), state.least), state.most))
