"""Discs cover as much as the surface does: whole ones inside, smaller ones at edges."""

from __future__ import annotations

import numpy as np
import pytest
from surfel_cases import surface

from vegtool.gl.points import SurfelSetBuffers
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display
from vegtool.measure.pictures import live_surfels, truth
from vegtool.measure.views import around, views
from vegtool.plant import Plant
from vegtool.surfel_set import SurfelSet
from vegtool.surfels.blue.candidates import candidates
from vegtool.surfels.blue.covering import _share, doublings, inside
from vegtool.surfels.blue.distances import spacing
from vegtool.surfels.blue.farthest import farthest_order
from vegtool.surfels.blue.make import ordered, surfels_of

Z = np.array([0.0, 0.0, 1.0])


def flat(points: np.ndarray, count: int) -> SurfelSet:
    at = points[farthest_order(points, count)]
    return SurfelSet(at, np.tile(Z, (count, 1)), np.ones((count, 3)), spacing(at))


def test_a_sheet_is_whole_but_at_its_edges() -> None:
    side = np.random.default_rng(0).random((40_000, 2))
    sheet = flat(np.column_stack([side, np.zeros(len(side))]), 2000)
    found = inside(sheet)
    edge = np.minimum(sheet.position[:, :2], 1 - sheet.position[:, :2]).min(axis=1)
    radius = sheet.spacing.radius(1000)
    late = np.arange(2000) >= 1000
    assert found[late & (edge > 1.8 * radius)].mean() > 0.99
    assert found[late & (edge < 0.2 * radius)].mean() < 0.1


def test_nothing_of_a_line_is_inside() -> None:
    """Though it has many more points than discs of its spacing by the square root would need."""
    line = np.outer(np.random.default_rng(0).random(40_000), [1.0, 0.0, 0.0])
    assert inside(flat(line, 2000)).max() == 0


def test_sizes_are_tried_downwards_until_coverage_is_right() -> None:
    """Coverage that grows with the size, right at 0.4; always in excess; and less accurate with
    every step."""
    assert _share(lambda size: (size - 0.4, abs(size - 0.4))) == pytest.approx(0.4)
    assert _share(lambda size: (1.0, size)) < 0.07
    assert _share(lambda size: (1.0, -size)) == 1.0
    assert _share(lambda size: (-1.0, size)) == 1.0


def test_what_doublings_add_is_all_there_is() -> None:
    assert doublings(1000, 256) == [(0, 256), (256, 512), (512, 1000)]
    assert doublings(512, 256) == [(0, 256), (256, 512)]
    assert doublings(3, 256) == [(0, 3)]


def leaves(many: int = 300, size: float = 0.06) -> Plant:
    """Triangles in all directions, scattered in a cube of a metre."""
    random = np.random.default_rng(0)
    corners = random.random((many, 1, 3)) + size * random.normal(size=(many, 3, 3))
    return surface(corners.reshape(-1, 3), np.arange(3 * many).reshape(-1, 3))


@pytest.mark.gl
def test_leaves_are_not_fattened() -> None:
    """Seen from other sides and at other sizes than they were measured at."""
    plant = leaves()
    with PlantBuffers(plant) as buffers:
        plain = ordered(candidates(buffers, 256), 3000)
        right = surfels_of(buffers, 3000, resolution=256)
        assert np.array_equal(plain.position, right.position)
        assert right.size.min() < 0.7
        bias = []
        for surfels in (plain, right):
            covered = known = 0.0
            with SurfelSetBuffers(surfels) as drawn:
                for view in views("all", 4, 0.5):
                    away = Display().distance_m(15 / plant.extent)
                    camera = around(plant.positions, view.direction, away, Display())
                    known += float(truth(buffers, camera)[..., 3].sum())
                    covered += float(live_surfels(drawn, camera)[..., 3].sum())
            bias.append(covered / known - 1)
    assert bias[0] > 1 and abs(bias[1]) < 0.1, "leaves are smaller than what is between them"


@pytest.mark.gl
@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_few_surfels_have_sizes_too(count: int) -> None:
    with PlantBuffers(leaves(3)) as buffers:
        assert len(surfels_of(buffers, count, resolution=64).size) == count
