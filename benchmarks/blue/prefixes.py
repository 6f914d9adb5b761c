"""Pictures of prefixes of several orders of the same candidates, beside the original.

Discs are the same for all: as large as prefixes of our order ask for. An order at random would ask
for discs of half the size by its own distances, and leave more holes. Single pixels are the paper's
(section 6 states what comes of it), means are ours. Some prefixes are drawn again, with discs that
cover, in each order, as much as the original does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree
from solids import airplane, armadillo
from solids.airplane import FINE

from blue.orders import random_order
from vegtool.arrays import FloatArray, Picture
from vegtool.gl.points import SurfelSetBuffers
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import Display
from vegtool.measure.metrics import Reference, reference, score
from vegtool.measure.pictures import live_surfels, truth
from vegtool.measure.views import Camera, around, distance_of, views
from vegtool.plant import Plant
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.candidates import candidates
from vegtool.surfels.blue.make import ordered, surfels_of
from vegtool.surfels.blue.randomised import randomised_order

MODELS: dict[str, Callable[[], Plant]] = {
    "tree": lambda: sample("broadleaf"),
    "statue": armadillo,
    "airplane": lambda: airplane(FINE),
}
POINTS = 100_000
PREFIXES = (100, 300, 1_000, 3_000, 10_000, 30_000, POINTS)
PIXELS = 400.0
"""Of the model's longest side."""
VIEWS = 6
EQUAL_PREFIXES = (1_000, 10_000, POINTS)
FACTORS, HALVINGS = (0.25, 2.0), 6
"""Of radii of discs, among which those are looked for that cover as much."""
EVERY = 2
"""Views of which one is looked at for that."""
SCORES = ("flip", "ssim", "false_holes", "coverage_bias")
SHOWN = ("tree", "statue")
SHOWN_PREFIXES = (100, 1_000, 10_000, POINTS)
SHOWN_PIXELS = 290.0
SHOWN_VIEW = 2
DISPLAY = Display()
SLIGHTLY = 1e-9
"""More than the radius, relative: a prefix's own radius is that of no longer one by rounding."""


@dataclass(frozen=True, eq=False)
class Scores:
    """Of a prefix of an order, means of VIEWS. disc_px: mean diameter of its discs, as seen at the
    nearest point of the bounds. factor: of their radii, where discs are such that they cover as
    much as the original; None where they are as asked."""

    model: str
    order: str
    points: int
    disc_px: float
    factor: float | None
    means: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class Sight:
    """One picture to be compared with."""

    camera: Camera
    light: Light
    true: Reference


@dataclass(frozen=True, eq=False)
class Shown:
    """A prefix of ours: a picture as large as all, and one of as many pixels as it is meant for,
    where discs are a pixel large; beside each, the original."""

    points: int
    large: Picture
    large_truth: Picture
    own: Picture
    own_truth: Picture


def measured(name: str) -> tuple[list[Scores], list[Shown]]:
    """Of one of MODELS. Pictures where it is SHOWN."""
    plant, found, pictures = MODELS[name](), [], []
    with PlantBuffers(plant) as original:
        seen = sights(original)
        for order, some in sets(original).items():
            with SurfelSetBuffers(some) as buffers:
                for points in PREFIXES:
                    found.append(scores(name, order, buffers, points, seen))
                if order == "ours" and name in SHOWN:
                    pictures = list(shown(original, buffers))
            for points in EQUAL_PREFIXES:
                factor = covering(some, points, seen[::EVERY])
                with resized(some, factor) as buffers:
                    found.append(scores(name, order, buffers, points, seen, factor))
    return found, pictures


def sets(original: PlantBuffers) -> dict[str, SurfelSet]:
    """Surfels by order, of the same candidates."""
    found = candidates(original)
    ours = surfels_of(original, POINTS)
    plain = ordered(found, POINTS, unlit=ours.unlit)  # all discs as large as their spacing says
    at_random = found.of(random_order(found.position, POINTS))
    papers = found.of(randomised_order(found.position, POINTS))
    same = found.of(cKDTree(found.position).query(ours.position)[1])
    return {
        **{
            name: replace(plain, position=some.position, normal=some.normal, color=some.color)
            for name, some in {"random": at_random, "randomised": papers}.items()
        },
        "ours, single": replace(ours, normal=same.normal, color=same.color),
        "ours": ours,
    }


def sights(original: PlantBuffers) -> list[Sight]:
    found = []
    for view in views("all", VIEWS):
        camera, light = camera_of(original.plant, view.direction, PIXELS), Light(view.sun)
        found.append(Sight(camera, light, reference(truth(original, camera, light))))
    return found


def scores(
    model: str, order: str, buffers: SurfelSetBuffers, points: int, seen: Sequence[Sight],
    factor: float | None = None,
) -> Scores:  # fmt: skip
    found = [score(one.true, prefix_of(buffers, points, one.camera, one.light)) for one in seen]
    disc = float(np.mean([size_px(buffers, points, one.camera) for one in seen]))
    means = {key: float(np.mean([one[key] for one in found])) for key in SCORES}
    return Scores(model, order, points, disc, factor, means)


def resized(some: SurfelSet, factor: float) -> SurfelSetBuffers:
    """The same with discs of so many times the radius."""
    spacing = replace(some.spacing, radius_m=factor * some.spacing.radius_m)
    return SurfelSetBuffers(replace(some, spacing=spacing))


def covering(some: SurfelSet, points: int, seen: Sequence[Sight]) -> float:
    """The factor with which a prefix covers as much of pictures as the original does: coverage
    grows with it."""
    low, high = FACTORS
    for _ in range(HALVINGS):
        middle, more = (low * high) ** 0.5, 0.0
        with resized(some, middle) as buffers:
            for one in seen:
                picture = prefix_of(buffers, points, one.camera, one.light)
                more += float(picture[..., 3].sum(dtype=np.float64)) - one.true.covered
        low, high = (low, middle) if more > 0 else (middle, high)
    return float((low * high) ** 0.5)


def shown(original: PlantBuffers, buffers: SurfelSetBuffers) -> Iterator[Shown]:
    view = views("all", VIEWS)[SHOWN_VIEW]
    light, plant = Light(view.sun), original.plant
    camera = camera_of(plant, view.direction, SHOWN_PIXELS)
    whole = truth(original, camera, light)
    for points in SHOWN_PREFIXES:
        large = prefix_of(buffers, points, camera, light)
        own = plant.extent / (2 * buffers.surfels.spacing.radius(points))
        near = camera_of(plant, view.direction, own)
        yield Shown(
            points, large, whole,
            prefix_of(buffers, points, near, light), truth(original, near, light),
        )  # fmt: skip


def prefix_of(buffers: SurfelSetBuffers, points: int, camera: Camera, light: Light) -> Picture:
    """What a viewer shows that is content with the discs of such a prefix."""
    return live_surfels(buffers, camera, light, size_px(buffers, points, camera))


def size_px(buffers: SurfelSetBuffers, points: int, camera: Camera) -> float:
    """Pixels: diameter of the discs of a prefix, at the nearest point of the bounds."""
    one = np.ones(1)
    pixel_m = buffers.pixels(camera.eye, np.zeros((1, 3)), 0 * one, one, camera.focal_px)
    radius = (1 + SLIGHTLY) * buffers.surfels.spacing.radius(points)
    return 2 * radius / float(pixel_m[0])


def camera_of(plant: Plant, direction: FloatArray, longest_px: float) -> Camera:
    away = distance_of(plant, DISPLAY, longest_px)
    return around(plant.positions, direction, away, DISPLAY)
