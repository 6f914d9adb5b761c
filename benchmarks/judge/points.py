"""What was found of a plant at one distance from one set of views."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from judge.chains import DISTANCES, limits
from judge.impostor import Impostor
from judge.scores import Score, score
from judge.sitting import VIEWS, Sitting, sit


@dataclass(frozen=True)
class Drawn:
    """Something drawn in three.js, and what the client holds of it."""

    score: Score
    triangles: int
    texels: int


@dataclass(frozen=True)
class Point:
    """One plant at one distance from one set of views.

    options: of vegtool convert. most: triangles allowed. texels: of the whole chain. here,
    impostor: FLIP of the level and of the impostor in vegtool's own renderer. drawn: by name.
    """

    plant: str
    views: str
    distance: float
    options: str
    level: str
    most: int
    texels: int
    here: float
    impostor: float
    drawn: dict[str, Drawn]

    @property
    def ours(self) -> Drawn:
        return self.drawn[Sitting.OURS]

    @property
    def live(self) -> float:
        """The live original's FLIP."""
        return self.drawn[Sitting.LIVE].score.flip

    @property
    def ratio(self) -> float:
        """FLIP over the live original's."""
        return self.ours.score.flip / self.live

    @property
    def where(self) -> str:
        after = "" if self.views == "standard" else f", {self.views}"
        return f"{self.plant} at {self.distance:g}{after}"


def over(points: Sequence[Point], what: str) -> list[float]:
    """FLIP over that of something else, wherever it was drawn."""
    return [p.ours.score.flip / p.drawn[what].score.flip for p in points if what in p.drawn]


def points_of(
    name: str,
    model: Path,
    options: str,
    sets: Sequence[str],
    folder: Path,
    cache: Path | None,
    stock_truth: bool = False,
) -> Iterator[Point]:
    """All of one plant; as for `sit`."""
    sitting = sit(model, options, sets, folder, cache, stock_truth)
    most = limits(len(sitting.plant.faces))
    levels = [sitting.chain.file(level) for level in sitting.shown]
    for views in sets:
        impostor = Impostor(sitting.plant, DISTANCES, VIEWS[views])
        here = impostor.flips(levels).tolist()
        for i, distance in enumerate(DISTANCES):
            truth = sitting.pictures(views, Sitting.TRUTH, i)
            drawn = {}
            for what in sitting.beside:
                shown = sitting.pictures(views, what, i)
                drawn[what] = Drawn(score(truth, shown), shown.triangles, shown.texels)
            yield Point(
                name,
                views,
                distance,
                sitting.chain.options,
                str(sitting.shown[i]["file"]),
                most[i],
                sitting.chain.texels,
                *here[i],
                drawn,
            )
