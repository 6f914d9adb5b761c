"""Whether one level becomes the next without a jump: an eye that walks straight towards one plant.

Around each distance range in which one level fades into another the eye walks at 30 frames per
second, as fast as people do and as cars do in a wood. Pairs of successive frames are drawn (PAIRS
of those that there are, and those in which the range begins and ends), each beside the truth, the
plant in full at 8 x 8 samples a pixel. Two figures: how much of the picture the plant covers, over
what it covers in truth; and FLIP between the two frames, over the truth's own between the same two.

What is below SEEN counts as SEEN in both: where the eye is so far away that the truth stands still,
there is nothing to compare with. The original, drawn as a client does, is told beside the levels:
what of a change is multisampling.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from math import atan, ceil, degrees
from pathlib import Path
from typing import cast, get_args

import numpy as np

from vegtool.arrays import FloatArray, Picture
from vegtool.elements import ordered
from vegtool.formats import ReadOptions
from vegtool.measure.background import over
from vegtool.measure.flip import difference, perceived
from vegtool.preview.choice import Kinds, kinds_of, switches
from vegtool.preview.eye import Eye, towards
from vegtool.preview.forest import CALIBRATED_PX, Forest
from vegtool.preview.options import FadeMode
from vegtool.preview.scenery import IN_FULL, Look
from vegtool.preview.world import Row
from vegtool.tiles.library import Species, read_library
from walk.path import HEIGHT_M
from walk.truth import WHOLE

SPEEDS_M_S = (1.5, 15.0)
FPS = 30.0
PAIRS = 8
"""Of successive frames, of each transition and speed; and two more."""
MARGIN = 0.1
"""Of a fade's range, to either side of it."""
SUPERSAMPLE = 8
SEEN = 1e-3
"""Mean FLIP over the plant's picture: less is not seen."""
SPARE = 1.15
"""Of the plant's size, that a picture shows."""
LIVE = "original"
"""Drawn as clients do, beside the levels."""
FADES: tuple[FadeMode, ...] = get_args(FadeMode)


@dataclass(frozen=True)
class Transition:
    """Where level `level` takes over from the one before it: distances in metres to the middle."""

    level: int
    start_m: float
    end_m: float


@dataclass(frozen=True)
class Changes:
    """What was found at a transition. fade: a FadeMode, or LIVE. steps: pairs of frames that the
    walk has, of which some were drawn. coverage: of what is drawn over the truth's, the one
    farthest from 1. ratios: FLIP between two frames over the truth's, of each pair. still: pairs
    between which the truth changed by less than SEEN."""

    library: str
    species: str
    fade: str
    speed_m_s: float
    transition: Transition
    steps: int
    coverage: float
    ratios: tuple[float, ...]
    still: int


def changes(folder: Path, library: str, name: str, pairs: int) -> Iterator[Changes]:
    """All transitions of one species of a folder, at all speeds and with all fades."""
    (species,) = read_library(folder / f"{name}.lod.json", ReadOptions())
    kinds = _kinds(species)
    with ExitStack() as stack:
        forests = {fade: _loaded(stack, species, fade) for fade in FADES}
        truth = _loaded(stack, species, FADES[0], sharp=True)
        for transition in transitions(kinds):
            for speed in SPEEDS_M_S:
                yield from _compared(
                    library, species, kinds, transition, speed, pairs, forests, truth
                )


def transitions(kinds: Kinds) -> list[Transition]:
    """Of the only kind there is, at detail 1."""
    at = switches(kinds, 1.0)
    return [
        Transition(level, float(at.start[0, level]), float(at.end[0, level]))
        for level in range(1, int(kinds.count[0]))
    ]


def walked_m(transition: Transition, below_m: float, speed_m_s: float) -> FloatArray:
    """(n,) metres from the eye to the plant along the ground, farthest first, frame by frame.

    below_m: height of the eye above the plant's middle.
    """
    spare = MARGIN * (transition.end_m - transition.start_m)
    low, high = (
        max(d**2 - below_m**2, 0.0) ** 0.5
        for d in (transition.start_m - spare, transition.end_m + spare)
    )
    step = speed_m_s / FPS
    return high - step * np.arange(max(ceil((high - low) / step), 1) + 1)


def chosen_pairs(
    away_m: FloatArray, transition: Transition, below_m: float, most: int
) -> list[int]:
    """Which of the frames pairs begin with: `most` evenly, and those with the fade's ends."""
    last = len(away_m) - 2
    found = {round(i) for i in np.linspace(0, last, min(most, last + 1))}
    distance = np.hypot(away_m, below_m)
    for end in (transition.start_m, transition.end_m):
        after = int(np.argmax(distance < end)) if (distance < end).any() else 0
        found.add(min(max(after - 1, 0), last))
    return sorted(found)


def _compared(
    library: str,
    species: Species,
    kinds: Kinds,
    transition: Transition,
    speed: float,
    pairs: int,
    forests: dict[FadeMode, Forest],
    truth: Forest,
) -> Iterator[Changes]:
    middle = float(kinds.center[0])
    below = HEIGHT_M - middle
    away = walked_m(transition, below, speed)
    begins = chosen_pairs(away, transition, below, pairs)
    size, fov = _frame(species, float(np.hypot(away[-1], below)))
    ratios: dict[str, list[float]] = {drawn: [] for drawn in (*FADES, LIVE)}
    coverage: dict[str, list[float]] = {drawn: [] for drawn in (*FADES, LIVE)}
    still = 0
    for begin in begins:
        eyes = [_eye(float(away[i]), middle, fov) for i in (begin, begin + 1)]
        real = [truth.picture(eye, size, WHOLE, SUPERSAMPLE, 0) for eye in eyes]
        moved = _apart(*real)
        still += moved < SEEN
        for drawn in ratios:
            held = Look(detail=IN_FULL, level=0) if drawn == LIVE else Look()
            forest = forests[FADES[0] if drawn == LIVE else cast(FadeMode, drawn)]
            shown = [forest.picture(eye, size, held) for eye in eyes]
            ratios[drawn].append(max(_apart(*shown), SEEN) / max(moved, SEEN))
            coverage[drawn] += [
                float(a[..., 3].sum(dtype=np.float64) / b[..., 3].sum(dtype=np.float64))
                for a, b in zip(shown, real, strict=True)
            ]
    for drawn, found in ratios.items():
        worst = max(coverage[drawn], key=lambda c: abs(c - 1))
        yield Changes(
            library, species.name, drawn, speed, transition, len(away) - 1, worst, tuple(found),
            still,
        )  # fmt: skip


def _apart(before: Picture, after: Picture) -> float:
    """Mean FLIP between two frames."""
    error = difference(perceived(over(before)), perceived(over(after)))
    return float(error.mean(dtype=np.float64))


def _frame(species: Species, nearest_m: float) -> tuple[tuple[int, int], float]:
    """Pixels and field of view of a picture that shows all of a plant, with as many pixels to the
    metre as frames of 1024 x 768 have."""
    low, high = species.levels[0].bounds
    across = 2 * float(np.hypot(*np.abs(np.stack([low, high]))[:, [0, 2]].max(axis=0)))
    largest = SPARE * float(np.hypot(across, high[1] - low[1]))
    pixels = ceil(largest * CALIBRATED_PX / max(nearest_m - largest / 2, largest / 2)) + 8
    return (pixels, pixels), degrees(2 * atan(pixels / 2 / CALIBRATED_PX))


def _eye(away_m: float, middle_m: float, fov_y_deg: float) -> Eye:
    position = np.array([0.0, HEIGHT_M, away_m])
    yaw, pitch = towards(np.array([0.0, middle_m, 0.0]) - position)
    return Eye(position, yaw, pitch, fov_y_deg)


def _kinds(species: Species) -> Kinds:
    elements = [[ordered(level) for level in species.levels]]
    return kinds_of([species], elements, [list(range(len(species.levels)))], CALIBRATED_PX)


def _loaded(stack: ExitStack, species: Species, fade: FadeMode, *, sharp: bool = False) -> Forest:
    kinds: Sequence[Species] = (species,)
    placement = Row(np.zeros((1, 3)), 1.0)
    forest = stack.enter_context(Forest(kinds, placement, None, fade, sharp=sharp))
    for _ in forest.load():
        pass
    return forest
