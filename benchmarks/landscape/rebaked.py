"""Squares clustered anew beside a plain subsample of their quarters of as many triangles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vegtool.formats import read_plant
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Level
from vegtool.measure.scores import TruthsAt, scores
from vegtool.plant import Plant
from vegtool.seeding import generator
from vegtool.tiles.jobs import World, file_of
from vegtool.tiles.journal import read_journal
from vegtool.tiles.make import SEEN_FROM
from vegtool.tiles.recluster import VIEWS, group_of


@dataclass(frozen=True)
class Compared:
    """FLIP of a square's quarters drawn as the square, and as a subsample, at the distance where
    the square takes over."""

    side_m: float
    quarters: int
    triangles: int
    rebaked: float
    subsample: float

    @property
    def better(self) -> float:
        """Share by which the square errs less."""
        return 1 - self.rebaked / self.subsample


def compared(world: World) -> list[Compared]:
    """One square of each height, the first that was clustered anew."""
    tree, entries, found = world.pyramid.tree, read_journal(world.out), []
    for height in range(tree.depth + 1):
        nodes = tree.nodes(tree.depth - height)
        made = [n for n in nodes if entries[str(n)].facts.get("kind") == "reclustered"]
        if made:
            node = made[len(made) // 2]
            origin = world.pyramid.origin(node)
            quarters = [q for q in tree.quarters(node) if entries[str(q)].files]
            plants = [read_plant(world.out / file_of(one)) for one in quarters]
            group = group_of(
                plants, [world.pyramid.origin(one) - origin for one in quarters], str(node)
            )
            away = world.pyramid.from_m(height) + SEEN_FROM * tree.side(node.level)
            tile = read_plant(world.out / file_of(node))
            with PlantBuffers(group) as buffers:
                truth = TruthsAt(group, VIEWS, world.pyramid.display, buffers)(away)
                errs = [
                    float(scores(truth, Level("mesh", mesh=one)).values["flip"].mean())
                    for one in (tile, subsample(group, len(tile.faces)))
                ]
            found.append(Compared(tree.side(node.level), len(group.faces), len(tile.faces), *errs))
    return found


def subsample(plant: Plant, triangles: int) -> Plant:
    """So many of a plant's faces, in pairs as billboards have them, at random."""
    pairs = len(plant.faces) // 2
    kept = np.sort(generator(0, "subsample").permutation(pairs)[: max(triangles // 2, 1)])
    faces = (2 * kept[:, None] + np.arange(2)).ravel()
    return replace(
        plant, faces=plant.faces[faces], face_material=plant.face_material[faces], branches=None
    )
