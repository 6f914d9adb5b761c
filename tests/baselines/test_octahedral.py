from __future__ import annotations

import numpy as np
import pytest
from surfaces import plant_from, sphere

from vegtool.arrays import unit
from vegtool.baselines.octahedral import FRAMES, Octahedral, directions, nearest
from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import Display
from vegtool.measure.pictures import client_plant, live, truth
from vegtool.measure.views import View, around, upright
from vegtool.plant import Material

UP = np.array([0.0, 1.0, 0.0])
FARTHEST_DEG = 10.0
"""Stated in the module and in docs/methods/baselines.md."""


def view(direction: np.ndarray) -> View:
    return View(direction, UP)


def map_place(direction: np.ndarray) -> tuple[float, float]:
    """Where in the unit square the map has a direction, by folding as the paper does: project onto
    the octahedron, then turn the lower half's four triangles outwards over their edges."""
    x, y, z = direction / np.abs(direction).sum()
    if y < 0:
        x, z = (1 - abs(z)) * (1 if x >= 0 else -1), (1 - abs(x)) * (1 if z >= 0 else -1)
    return (x + 1) / 2, (z + 1) / 2


@pytest.mark.parametrize("side", [1, 2, 5, 16])
def test_the_map_and_back(side: int) -> None:
    """Every direction is the middle of its own cell."""
    places = np.array([map_place(d) for d in directions(side)])
    row, column = np.divmod(np.arange(side * side), side)
    np.testing.assert_allclose(places, (np.stack([column, row], 1) + 0.5) / side, atol=1e-12)


def test_every_direction_has_a_frame_near_by() -> None:
    frames = directions()
    assert frames.shape == (FRAMES**2, 3)
    assert len(np.unique(np.round(frames, 9), axis=0)) == FRAMES**2
    i = np.arange(20_000)
    y, phi = 1 - (2 * i + 1) / len(i), i * np.pi * (3 - 5**0.5)
    r = np.sqrt(1 - y * y)
    spread = np.stack([r * np.cos(phi), y, r * np.sin(phi)], axis=1)
    off = np.degrees(np.arccos(np.minimum((spread @ frames.T).max(axis=1), 1)))
    assert off.max() < FARTHEST_DEG
    assert off.mean() < 5.1
    assert all(nearest(frames, d) == n for n, d in enumerate(frames))


def test_the_map_is_even_in_all_eight_octants() -> None:
    """A triangle of 7 + 6 + ... + 1 cells in each, and 32 on the edge between the halves."""
    frames = directions()
    for sign in np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T:
        assert (frames * sign > 1e-9).all(axis=1).sum() == 28
    assert (np.abs(frames[:, 1]) < 1e-9).sum() == 32


@pytest.mark.parametrize("direction", [[0, 1, 0], [0, -1, 0], [1, 0, 0], [1, 2, -3]])
def test_pictures_stand_upright(direction: list[float]) -> None:
    towards = unit(np.array([direction], float))[0]
    right, up = upright(towards)
    np.testing.assert_allclose(np.cross(right, up), towards, atol=1e-12)
    assert right[1] == pytest.approx(0)
    assert up[1] >= 0


@pytest.mark.gl
def test_only_frames_that_are_asked_for_are_baked_and_once() -> None:
    made = Octahedral(sphere(8, 16))
    assert made.baked == 0 and made.seconds == {}
    above, beside = unit(np.array([[0.05, 1, 0.05], [0.06, 1, 0.04]]))
    frame = made(view(above))
    assert made(view(beside)) is frame
    assert made(view(-UP)) is not frame
    assert made.baked == 2
    assert frame.triangles == made.triangles == 2
    assert made.texels == 2 * 2048**2
    assert set(made.seconds) == set(frame.seconds)
    assert made.seconds["draw"] > 100 * min(frame.seconds["draw"], made(view(-UP)).seconds["draw"])


@pytest.mark.gl
def test_the_quad_faces_its_frames_direction_and_holds_the_bounding_sphere() -> None:
    made = Octahedral(sphere())
    for direction in unit(np.array([[1.0, 0.2, 0.3], [0, -1, 0.1], [-1, 0, 0]])):
        b = made(view(direction)).billboards
        assert b is not None
        frame = made.directions[nearest(made.directions, direction)]
        np.testing.assert_allclose(b.normal[0], frame, atol=1e-12)
        np.testing.assert_allclose(b.half_size, 1.0, atol=1e-12)
        assert b.normal[0] @ direction > np.cos(np.radians(FARTHEST_DEG))


@pytest.mark.gl
@pytest.mark.parametrize("number", [0, 37, 120, 200])
def test_a_frame_is_lit_as_the_plant_is(number: int) -> None:
    """A sphere seen as its frame sees it, a sun from the side: the same light on the same side."""
    plant = sphere()
    made = Octahedral(plant)
    direction = made.directions[number]
    right, up = upright(direction)
    light = Light(direction=right + 0.3 * up)
    camera = around(plant.positions, direction, 30.0, Display())
    with PlantBuffers(plant) as buffers:
        wanted = truth(buffers, camera, light)
    with PlantBuffers(client_plant(made(view(direction))), mipmaps=True) as buffers:
        found = live(buffers, camera, light)
    both = (wanted[..., 3] > 0.99) & (found[..., 3] > 0.99)
    assert both.sum() > 0.9 * (wanted[..., 3] > 0.5).sum()
    assert np.ptp(wanted[..., 0][both]) > 0.4  # there is a bright and a dark side
    np.testing.assert_allclose(found[..., 0][both], wanted[..., 0][both], atol=0.06)
    assert np.abs(found[..., 3] - wanted[..., 3]).sum() < 0.05 * wanted[..., 3].sum()


@pytest.mark.gl
def test_a_single_sided_leaf_is_seen_from_its_front_alone() -> None:
    """And its picture is not turned round where more is seen from behind."""
    corners = [[-1, -1, 0], [1, -1, 0], [0, 1, 0]]
    plant = plant_from(corners, [[0, 1, 2]], materials=[Material("leaf", role="leaf")])
    made = Octahedral(plant)
    front, back = (made(view(np.array([0.1, 0.1, z]) / np.hypot(1, 0.02**0.5))) for z in (1, -1))
    assert front.atlas is not None and back.atlas is not None
    assert front.atlas.color[..., 3].any()
    assert not back.atlas.color[..., 3].any()
    assert back.billboards is not None and back.billboards.normal[0, 2] < 0
