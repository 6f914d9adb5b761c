"""What is asked of the levels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from judge.impostor import Impostor
from judge.points import Point, over
from judge.scores import geometric_mean
from judge.sitting import Sitting

ERRS = 0.12
"""FLIP of the live original: from here on a level is to be closer to the truth by a ratio."""
RATIO_MEAN, RATIO_WORST = 0.40, 0.60
NEAR = 0.10
"""FLIP of a level, where the live original errs less than ERRS."""
AIM_MEAN, AIM_NEAR = 0.25, 0.06
MARGIN = 0.05
"""Of ratios, from held-out views."""
COVERAGE, COLOR = 0.05, 0.03
"""Bias, either way."""
TEXELS, IMPOSTOR_SHARE = 1_500_000, 1 / 5
"""Of the whole chain: in all, and of the impostor's."""
REDUCED_MEAN = 0.45
"""Of gltfpack's FLIP."""
TIME = 2.5
"""Of the plain method's."""


@dataclass(frozen=True)
class Check:
    """Something asked: `found` is to be at most `most`."""

    what: str
    found: float
    most: float

    @property
    def met(self) -> bool:
        return self.found <= self.most


def checks(points: Sequence[Point]) -> Iterator[Check]:
    """Of all points from one set of views."""
    standard = points[0].views == "standard"
    margin, after = (0.0, "") if standard else (MARGIN, f", {points[0].views}")
    for p in points:
        score = p.ours.score
        if p.live >= ERRS:
            yield Check(f"{p.where}: FLIP over the live original's", p.ratio, RATIO_WORST + margin)
        else:
            yield Check(f"{p.where}: FLIP, where the live original is good", score.flip, NEAR)
        yield Check(f"{p.where}: triangles", p.ours.triangles, p.most)
        yield Check(f"{p.where}: coverage bias", abs(score.coverage), COVERAGE)
        yield Check(f"{p.where}: colour bias", abs(score.color), COLOR)
        yield Check(f"{p.where}: FLIP beside the impostor's", p.here, p.impostor)
    ratios = [p.ratio for p in points if p.live >= ERRS]
    what = f"geometric mean of FLIP over the live original's{after}"
    yield Check(what, geometric_mean(ratios), RATIO_MEAN + margin)
    if packed := over(points, Sitting.REDUCED):
        what = f"geometric mean of FLIP over gltfpack's{after}"
        yield Check(what, geometric_mean(packed), REDUCED_MEAN + margin)


def costs(points: Sequence[Point], seconds: Mapping[str, tuple[float, float]]) -> Iterator[Check]:
    """What does not depend on views. seconds: of the conversion and of the plain one, by plant."""
    for plant, texels in {p.plant: p.texels for p in points}.items():
        most = min(TEXELS, int(IMPOSTOR_SHARE * Impostor.texels))
        yield Check(f"{plant}: texels of the chain", texels, most)
    for plant, (whole, plain) in seconds.items():
        yield Check(f"{plant}: seconds over the plain method's", whole / plain, TIME)
