"""Candidates for surfels: all that is seen from outside, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plants import plant_of
from surfel_cases import both, surface

from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.plant import Material, Plant
from vegtool.surfels.blue.candidates import (
    PER_SURFEL,
    Candidates,
    Covered,
    candidates,
    corner_directions,
    enough,
    joined,
    missed,
    seen_from,
)

pytestmark = pytest.mark.gl
SMALL = 128
"""Pixels."""
CUBE = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
QUADS = np.array(
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)


def box(size: float = 1.0, inwards: bool = False) -> Plant:
    faces = np.concatenate([QUADS[:, [0, 1, 2]], QUADS[:, [0, 2, 3]]])
    return surface(CUBE * size, faces[:, ::-1] if inwards else faces)


def of(plant: Plant, resolution: int = SMALL) -> Candidates:
    with PlantBuffers(plant) as buffers:
        return candidates(buffers, resolution)


def test_all_sides_of_a_box_are_found_with_their_normals() -> None:
    found = of(box())
    assert np.abs(np.abs(found.position).max(axis=1) - 1).max() < 1e-5, "on the box"
    for axis in range(3):
        for sign in (-1, 1):
            on = sign * found.position[:, axis] > 1 - 1e-5
            spread = np.ptp(found.position[on], axis=0)
            assert on.sum() > 1000 and np.delete(spread, axis).min() > 1.95
    assert found.pixel_m == pytest.approx(2 * np.sqrt(3) / SMALL)


def test_what_is_hidden_is_not_found() -> None:
    """A box within a box, and the inside of one that looks inwards."""
    inner = of(both(box(), box(0.4)))
    assert np.abs(inner.position).max(axis=1).min() > 0.99
    hidden = of(replace(box(inwards=True), materials=(Material("one"), Material("other"))))
    assert len(hidden) == 0 or np.abs(hidden.position).max(axis=1).min() > 0.99


def test_both_sides_of_a_thin_plate_are_found() -> None:
    corners = np.array([[-1, -1, 1e-4], [1, -1, 1e-4], [1, 1, 1e-4], [-1, 1, 1e-4]])
    faces, up = np.array([[0, 1, 2], [0, 2, 3]]), np.tile([0.0, 0, 1], (4, 1))
    front = surface(corners, faces, normals=up)
    plate = both(front, surface(corners * [1, 1, -1], faces[:, ::-1], normals=-up))
    found = of(plate)
    up, down = found.normal[:, 2] > 0.9, found.normal[:, 2] < -0.9
    assert (up | down).all() and 0.8 < up.sum() / down.sum() < 1.25
    one_side = found.of(up)
    with PlantBuffers(plate) as buffers:
        assert missed(buffers, one_side, SMALL) == pytest.approx(0.5, abs=0.1)
        assert missed(buffers, found, SMALL) == 0


def test_further_directions_find_what_corners_miss() -> None:
    """Needles hide some of themselves from eight sides."""
    plant, pixels = sample("conifer", 4000), 2 * SMALL
    with PlantBuffers(plant) as buffers:
        eight = joined([seen_from(buffers, d, pixels) for d in corner_directions(plant)])
        all_of_it = candidates(buffers, pixels)
        before, after = missed(buffers, eight, pixels), missed(buffers, all_of_it, pixels)
    assert before > 0.01 and after < 0.002 and len(all_of_it) < 1.1 * len(eight)


def test_a_covered_sample_has_another_near_it_that_looks_its_way() -> None:
    """Against all pairs."""
    rng = np.random.default_rng(0)
    position = rng.uniform(-1, 1, (400, 3))
    normal = rng.normal(size=(400, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    all_of_them = Candidates(position, normal, np.ones((400, 3)), np.zeros(400, np.int32), 0.05)
    have, asked = all_of_them.of(np.arange(200)), all_of_them.of(np.arange(200, 400))
    covered = Covered(np.zeros(3), 0.05)
    covered.add(have)
    found = covered.covers(asked)
    apart = np.linalg.norm(asked.position[:, None] - have.position, axis=2)
    facing = np.einsum("ai,hi->ah", asked.normal, have.normal)
    assert not found[(apart > 0.2 * np.sqrt(3)).all(axis=1)].any()
    assert found[((apart < 0.1) & (facing > 0.9)).any(axis=1)].all()
    assert covered.covers(have).all() and 0 < found.sum() < 200


def test_moved_and_scaled_plants_have_moved_and_scaled_candidates() -> None:
    plant = sample("statue", 1000)
    other = replace(plant, positions=3.0 * plant.positions + np.array([5e5, 0, -2e5]))
    one, two = of(plant), of(other)
    assert len(one) == len(two) and two.pixel_m == pytest.approx(3 * one.pixel_m, rel=1e-6)
    moved = 3.0 * one.position + np.array([5e5, 0, -2e5])
    assert np.abs(moved - two.position).max() < 1e-3 * two.pixel_m + 1e-5


@pytest.mark.parametrize("positions", [np.zeros((3, 3)), np.diag([0.0, 0, 1])])
def test_what_has_no_surface_has_no_candidates(positions: np.ndarray) -> None:
    assert len(of(surface(positions, [[0, 1, 2]]))) == 0


def test_what_is_little_of_its_picture_is_looked_at_more_closely() -> None:
    """A needle: eight pictures of 128 pixels show few places of it, four times as many pixels along
    each side sixteen times as many."""
    needle = plant_of(np.array([[[0.0, 0, 0], [10, 0, 0], [0, 0.3, 0]]]))
    with PlantBuffers(needle) as buffers:
        few = candidates(buffers, 128)
        assert enough(buffers, len(few) // PER_SURFEL, 128).pixel_m == few.pixel_m
        many = enough(buffers, len(few), 128)
    assert len(many) == pytest.approx(PER_SURFEL * len(few), rel=0.1)
