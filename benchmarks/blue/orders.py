"""Orders of what eight pictures of a rabbit show: how long they take, and how even they are.

Brandt et al. 2019, table 2 and figure 3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch

import moderngl
import numpy as np
from solids.rabbit import rabbit

from vegtool.arrays import FloatArray, IntArray
from vegtool.gl.upload import PlantBuffers
from vegtool.plant import Plant
from vegtool.seeding import generator
from vegtool.surfels.blue.candidates import (
    RESOLUTION,
    Candidates,
    corner_directions,
    joined,
    seen_from,
)
from vegtool.surfels.blue.distances import relative
from vegtool.surfels.blue.exact import exact_order
from vegtool.surfels.blue.farthest import farthest_order
from vegtool.surfels.blue.randomised import randomised_order

CANDIDATES = 1_750_000
SIZES = (10_000, 50_000, 100_000)
"""Points of orders, of table 2."""
PREFIXES = (100, 300, 1_000, 3_000, 10_000, 30_000, 50_000, 100_000)
"""Points of whose distances something is asked."""
MS = 1e3


def random_order(positions: FloatArray, count: int, *, seed: int = 0) -> IntArray:
    """(count,) int32 candidates, uniformly at random."""
    order = generator(seed, "random order").permutation(len(positions))
    return order[:count].astype(np.int32)


METHODS: dict[str, Callable[..., IntArray]] = {
    "random": random_order,
    "randomised": randomised_order,
    "ours": farthest_order,
    "exact": exact_order,
}
"""randomised: the paper's."""


@dataclass(frozen=True, eq=False)
class Pictured:
    """Candidates, and (repeats,) ms of processor time: of drawing the eight pictures, all threads
    together, and of reading them back and making arrays of them. resolution: pixels along a
    picture's sides."""

    found: Candidates
    resolution: int
    render_ms: FloatArray
    set_up_ms: FloatArray


@dataclass(frozen=True, eq=False)
class Order:
    """A method, asked for so many points, once for each seed.

    cpu_ms, wall_ms: (seeds,). least, median: (prefixes,) of relative distances, medians of seeds.
    first: (points,) candidates, of the first seed.
    """

    method: str
    points: int
    cpu_ms: FloatArray
    wall_ms: FloatArray
    least: FloatArray
    median: FloatArray
    first: IntArray

    @property
    def prefixes(self) -> list[int]:
        return [prefix for prefix in PREFIXES if prefix <= self.points]


@dataclass(frozen=True, eq=False)
class Orders:
    """area: m2 of the model. compiling_s: before anything is timed."""

    pictured: Pictured
    area: float
    compiling_s: float
    all: tuple[Order, ...]

    def of(self, points: int) -> dict[str, Order]:
        """All methods' of one size."""
        return {one.method: one for one in self.all if one.points == points}


def measured(repeats: int) -> Orders:
    plant = rabbit()
    seen = pictured(plant, repeats)
    places, area = seen.found.position, float(plant.face_areas.sum())
    began = process_time()
    for method in METHODS.values():
        method(places[:1_000], 100)
    compiling = process_time() - began
    found = [one for points in SIZES for one in ordered(places, area, points, repeats)]
    return Orders(seen, area, compiling, tuple(found))


def pictured(plant: Plant, repeats: int) -> Pictured:
    """About CANDIDATES of a plant, by as many pixels as that takes."""
    directions = corner_directions(plant)
    render, set_up = np.zeros(repeats), np.zeros(repeats)
    with PlantBuffers(plant) as buffers:
        rough = sum(len(seen_from(buffers, one, RESOLUTION)) for one in directions)
        resolution = round(RESOLUTION * (CANDIDATES / rough) ** 0.5)
        seen_from(buffers, directions[0], resolution)  # what is drawn into grows
        for i in range(repeats):
            some = []
            for direction in directions:
                with finished_before_read(buffers.ctx) as finished:
                    began = process_time()
                    some.append(seen_from(buffers, direction, resolution))
                    ended = process_time()
                render[i] += finished[0] - began
                set_up[i] += ended - finished[0]
            began = process_time()
            found = joined(some)
            set_up[i] += process_time() - began
    return Pictured(found, resolution, MS * render, MS * set_up)


@contextmanager
def finished_before_read(ctx: moderngl.Context) -> Iterator[list[float]]:
    """Processor seconds at which pictures were finished, each before it is read back: what is drawn
    is drawn later otherwise, as part of the reading."""
    finished: list[float] = []
    read = moderngl.Framebuffer.read

    def timed(frame: moderngl.Framebuffer, *given: Any, **how: Any) -> bytes:
        ctx.finish()
        finished.append(process_time())
        return read(frame, *given, **how)

    with patch.object(moderngl.Framebuffer, "read", timed):
        yield finished


def ordered(places: FloatArray, area: float, points: int, repeats: int) -> list[Order]:
    """Every method's order of places (n, 3), metres; in turn for each seed, so that what else the
    machine does is shared."""
    prefixes = [prefix for prefix in PREFIXES if prefix <= points]
    cpu = {name: np.zeros(repeats) for name in METHODS}
    wall = {name: np.zeros(repeats) for name in METHODS}
    even = {name: np.zeros((2, len(prefixes), repeats)) for name in METHODS}
    first = {}
    for seed in range(repeats):
        for name, method in METHODS.items():
            began, since = process_time(), perf_counter()
            order = method(places, points, seed=seed)
            cpu[name][seed], wall[name][seed] = process_time() - began, perf_counter() - since
            first.setdefault(name, order)
            for i, prefix in enumerate(prefixes):
                apart = relative(places[order[:prefix]], area)
                even[name][:, i, seed] = apart.min(), np.median(apart)
    return [
        Order(
            name, points, MS * cpu[name], MS * wall[name],
            *np.median(even[name], axis=2), first[name],
        )
        for name in METHODS
    ]  # fmt: skip
