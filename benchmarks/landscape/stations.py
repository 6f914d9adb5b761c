"""How far what a client draws of tiles is from all plants in full, at stations fixed beforehand.

A client of a maximum screen-space error of 16 pixels, in a picture 1080 pixels high of 60 degrees,
of whose middle 1024 x 768 pixels are compared. The truth is every plant whole, 4 x 4 samples a
pixel (walk/truth.py), and kept.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan, degrees, radians, tan
from pathlib import Path
from time import perf_counter

import numpy as np
from walk.scenes import key_of, with_originals
from walk.truth import SUPERSAMPLE, Whole

from vegtool.arrays import Picture
from vegtool.formats import ReadOptions
from vegtool.formats.png import encode
from vegtool.lod import Display
from vegtool.measure.background import bytes_over, over
from vegtool.measure.flip import difference, perceived
from vegtool.preview.eye import Eye
from vegtool.preview.scenery import Look
from vegtool.preview.tile_world import read_tile_world
from vegtool.preview.world import read_world
from vegtool.tiles.journal import read_journal

SIZE = (1024, 768)
FOV_DEG = 2 * degrees(atan(SIZE[1] / 1080 * tan(radians(Display().fov_y_deg) / 2)))
"""Of as many pixels to the radian."""


@dataclass(frozen=True)
class Station:
    """position: metres, from the middle of the ground. asked: FLIP at most, or None."""

    name: str
    position: tuple[float, float, float]
    yaw_deg: float
    pitch_deg: float
    asked: float | None

    def eye(self, plants_side_m: float) -> Eye:
        """On a landscape of a side of so many metres: distances to it are the same."""
        x, y, z = self.position
        beyond = plants_side_m / 2 if self.name in ("near", "middle", "far") else 0.0
        return Eye(np.array([x, y, z + beyond]), self.yaw_deg, self.pitch_deg, FOV_DEG)


STATIONS = (
    Station("near", (0.0, 1.7, 3.0), 0.0, 0.0, 0.15),
    Station("in a branch", (3.0, 1.7, 5.0), 20.0, 0.0, 0.15),
    Station("middle", (10.0, 25.0, 120.0), 0.0, -8.0, 0.10),
    Station("far", (0.0, 120.0, 700.0), 0.0, -10.0, 0.10),
    Station("above", (0.0, 250.0, 150.0), 0.0, -60.0, None),
)
"""A walker 3 m before the plants; one between them, whose eye is in a conifer's branch; one on a
hill 120 m before them; one 700 m away; one above, of whom nothing is asked: there the truth itself,
blurred by two pixels, errs by 0.095."""


@dataclass(frozen=True)
class Seen:
    """What a client draws at a station: tiles by height, triangles, draw calls; FLIP of it; seconds
    of a frame."""

    station: str
    asked: float | None
    flip: float
    tiles: int
    kinds: str
    triangles: int
    draws: int
    frame_s: float


def seen(
    tiles: Path, scene: Path, library: Path, side_m: float, cache: Path, pictures: Path | None,
    stations: Sequence[Station] = STATIONS,
) -> list[Seen]:  # fmt: skip
    """Stations. pictures: folder for the truth and what was drawn, side by side."""
    found, shown = [], read_tile_world(tiles / "tileset.json")
    facts = {
        Path(file).name: entry.facts
        for entry in read_journal(tiles).values() for file in entry.files if entry.facts
    }  # fmt: skip
    forest = shown.scenery("none")
    with forest:
        for _ in forest.load():
            pass
        for station in stations:
            eye = station.eye(side_m)
            forest.picture(eye, SIZE, Look())  # loads what is not there yet
            started = perf_counter()
            picture = forest.picture(eye, SIZE, Look())
            seconds = perf_counter() - started
            drawn = forest.choose(eye, SIZE, Look())
            truth = _truth(eye, station, scene, library, cache)
            flip = float(difference(perceived(over(truth)), perceived(over(picture))).mean())
            told = [facts[Path(str(shown.tileset.file[tile])).name] for tile in drawn]
            kinds = Counter(one["kind"] for one in told)
            found.append(
                Seen(
                    station.name, station.asked, flip, len(drawn),
                    ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items())),
                    sum(one["triangles"] for one in told), sum(one["draws"] for one in told),
                    seconds,
                )
            )  # fmt: skip
            if pictures is not None:
                both = np.concatenate([bytes_over(truth), bytes_over(picture)], axis=1)
                pictures.mkdir(parents=True, exist_ok=True)
                (pictures / f"{station.name}.png").write_bytes(encode(both))
    return found


def _truth(eye: Eye, station: Station, scene: Path, library: Path, cache: Path) -> Picture:
    where = (*eye.position.tolist(), eye.yaw_deg, eye.pitch_deg, eye.fov_y_deg, SIZE, SUPERSAMPLE)
    originals = sorted(file.name for file in library.glob("*.lod.json"))
    key = key_of(scene.read_text("utf-8"), originals, where)
    file = cache / "truth" / f"{station.name}_{key}.npz"
    if not file.exists():
        print(f"drawing the truth: {station.name}", flush=True)
        world = with_originals(read_world(library, scene, ReadOptions()))
        with Whole(world) as whole:
            for _ in whole.load():
                pass
            picture = whole.truth(eye, SIZE)
        file.parent.mkdir(parents=True, exist_ok=True)
        begun = file.with_suffix(".part.npz")
        np.savez_compressed(begun, picture=picture.astype(np.float16))
        begun.rename(file)
    with np.load(file) as kept:
        return np.asarray(kept["picture"], np.float32)
