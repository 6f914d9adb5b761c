"""How far pictures of a walk are from the truth: every plant in view whole, 4 x 4 samples a pixel.

Drawing the truth takes minutes, so that each picture of it is kept; what was interrupted goes on.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vegtool.arrays import Picture
from vegtool.gl.context import check, framebuffer_kept
from vegtool.gl.draw import begin, resolved, tiles
from vegtool.gl.landscape import Frame
from vegtool.gl.targets import drawing_target
from vegtool.measure.background import over
from vegtool.measure.flip import Perceived, difference, perceived
from vegtool.preview.choice import frame
from vegtool.preview.eye import Eye
from vegtool.preview.forest import Forest
from vegtool.preview.scenery import IN_FULL, Look
from vegtool.preview.world import World
from walk.scenes import Say, key_of, with_crossed, with_originals
from walk.speed import SIZE

SUPERSAMPLE = 4
"""Samples per axis and pixel."""
TRIANGLES = 2_000_000
"""Drawn at a time: software keeps all that is not finished."""
WHOLE = Look(detail=IN_FULL, level=0)


class Whole(Forest):
    """A landscape of whole plants, drawn part by part: the truth."""

    def __init__(self, world: World) -> None:
        world = with_originals(world)
        super().__init__(world.species, world.placement, world.ground, sharp=True)

    def truth(self, eye: Eye, size: tuple[int, int] = SIZE) -> Picture:
        """Light and coverage, (h, w, 4)."""
        landscape = self._landscape
        assert landscape is not None
        found, what, _ = self.choose(eye, size, WHOLE)
        parts = list(self._parts(frame(found, what)))
        whole, ctx = np.empty((size[1], size[0], 4), np.float32), landscape.ctx
        with framebuffer_kept(ctx):
            for x, y, shot in tiles(ctx, eye.shot(*size), SUPERSAMPLE):
                pixels = SUPERSAMPLE * shot.width, SUPERSAMPLE * shot.height
                drawn = drawing_target(ctx, pixels, 0)
                begin(drawn, pixels)
                for index, part in enumerate(parts):
                    landscape.draw(part, shot, WHOLE.light, ground=index == 0)
                area = shot.width, shot.height
                mean = resolved(ctx, drawn, area, SUPERSAMPLE, 0)
                data = mean.frame.read((0, 0, *area), components=4, dtype="f4")
                found_here = np.frombuffer(data, np.float32).reshape(shot.height, shot.width, 4)
                whole[y : y + shot.height, x : x + shot.width] = found_here
            check(ctx)
        return whole

    def _parts(self, drawn: Frame) -> Iterator[Frame]:
        """A frame, TRIANGLES at a time; the ground alone, where there is nothing else."""
        yield Frame(drawn.rows[:0], ())
        for batch in drawn.batches:
            faces = len(self.species[batch.plant].levels[0].faces)
            count = max(TRIANGLES // faces, 1)
            for first in range(batch.first, batch.first + batch.count, count):
                some = drawn.rows[first : min(first + count, batch.first + batch.count)]
                yield Frame(some, (replace(batch, first=0, count=len(some)),))


@dataclass(frozen=True)
class Error:
    """FLIP of one picture. detail: of LEVELS; 0 for what has none."""

    scene: str
    station: int
    drawn: str
    detail: float
    flip: float


class Sitting:
    """A landscape loaded three times: by level, as crossed billboards and, once it is asked for,
    whole. A context manager."""

    def __init__(self, name: str, world: World, scene: Path, cache: Path, say: Say) -> None:
        self.name, self.world, self.say = name, world, say
        # the plants' own files are named by what made them
        self._key = key_of(scene.read_text("utf-8"), world.species[0].files[0].parent.name)
        self._folder = cache / "truth"
        self._folder.mkdir(parents=True, exist_ok=True)
        self._stack = ExitStack()
        self._whole: Whole | None = None

    def __enter__(self) -> Sitting:
        one, other = self.world, with_crossed(self.world)
        self.levels = self._loaded(Forest(one.species, one.placement, one.ground))
        self.crossed = self._loaded(Forest(other.species, other.placement, other.ground))
        return self

    def __exit__(self, *error: object) -> None:
        self._stack.close()

    def truth(self, eye: Eye) -> Picture:
        """Drawn, or as it was kept."""
        where = (*eye.position.tolist(), eye.yaw_deg, eye.pitch_deg, eye.fov_y_deg)
        file = self._folder / f"{self.name}_{key_of(self._key, where, SIZE, SUPERSAMPLE)}.npz"
        if not file.exists():
            if self._whole is None:
                self._whole = self._loaded(Whole(self.world))
            self.say(f"{self.name}: drawing the truth at {eye.position.round(1).tolist()}")
            found = self._whole.truth(eye)
            begun = file.with_suffix(".part.npz")
            np.savez_compressed(begun, picture=found.astype(np.float16))
            begun.rename(file)
        with np.load(file) as kept:
            return np.asarray(kept["picture"], np.float32)

    def shown(self, eye: Eye, detail: float) -> Picture:
        """By level."""
        return self.levels.picture(eye, SIZE, Look(detail=detail))

    def flat(self, eye: Eye) -> Picture:
        """As crossed billboards."""
        return self.crossed.picture(eye, SIZE, WHOLE)

    def _loaded(self, forest: Forest) -> Forest:
        self._stack.enter_context(forest)
        for _ in forest.load():
            pass
        return forest


def errors(
    sitting: Sitting, eyes: Sequence[tuple[int, Eye]], details: dict[str, float]
) -> Iterator[Error]:
    """FLIP at stations (number and eye). details: by what they are called."""
    for station, eye in eyes:
        seen = perceived(over(sitting.truth(eye)))
        for drawn, detail in details.items():
            flip = flip_of(seen, sitting.shown(eye, detail))
            yield Error(sitting.name, station, drawn, detail, flip)
        yield Error(sitting.name, station, "crossed", 0.0, flip_of(seen, sitting.flat(eye)))


def flip_of(truth: Perceived, picture: Picture) -> float:
    """Mean FLIP over what is behind all pictures."""
    return float(difference(truth, perceived(over(picture))).mean(dtype=np.float64))
