"""Validity of surfel billboards, by equations 1 to 8, beside what a camera sees."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.arrays import unit
from vegtool.lod import Display
from vegtool.surfels.validity import (
    distance_error,
    image_size,
    projection_error,
    spread,
    texel_error,
    z_min,
)

PC = Display().pixels_per_metre(1.0)


def test_sizes_are_those_of_a_camera() -> None:
    """A metre ten metres away, 60 degrees and 1,080 pixels high: 93.5 pixels."""
    assert image_size(np.array([1.0]), np.array([10.0]), PC)[0] == pytest.approx(93.5307, abs=1e-3)
    assert image_size(np.array([1.0]), np.array([0.0]), PC)[0] == np.inf


def test_projection_error_is_what_a_point_before_the_plane_moves() -> None:
    """A point d above the centre of a plane, seen from afar at the angle beta from its normal."""
    d, z = 0.1, 1000.0
    for beta in np.radians([0.0, 20.0, 60.0, 90.0]):
        eye = z * np.array([np.sin(beta), 0.0, np.cos(beta)])
        view = unit(-eye[None])
        moved = d * np.array([0.0, 0.0, 1.0])
        across = moved - (moved @ view[0]) * view[0]
        seen = np.linalg.norm(across) / z * PC
        normal = np.array([[0.0, 0.0, 1.0]])
        for way in (normal, -normal):
            found = projection_error(np.array([d]), way, -eye[None], np.array([z]), PC)
            assert found[0] == pytest.approx(seen, rel=1e-6)


def test_texels_cover_what_they_cover() -> None:
    """A billboard of 2 x 1 metres in 40 x 10 texels, of 5 and 10 centimetres: the longer counts."""
    found = texel_error(np.array([[1.0, 0.5]]), np.array([[40.0, 10.0]]), np.array([20.0]), PC)
    assert found[0] == pytest.approx(0.1 / 20 * PC)


@pytest.mark.parametrize("theta", [0.25, 0.5, 1.0])
def test_theta_is_a_share_of_all_directions(theta: float) -> None:
    """Of 200,000 of them, so many lie within beta of the normal, to either side."""
    direction = unit(np.random.default_rng(1).normal(size=(200_000, 3)))
    sine = np.sqrt(1 - direction[:, 2] ** 2)
    assert (sine <= spread(theta)).mean() == pytest.approx(theta, abs=0.005)


def test_at_z_min_the_error_is_epsilon() -> None:
    d, theta, epsilon = np.array([0.02, 0.3]), 0.5, 2.0
    z = z_min(distance_error(d, theta), epsilon, PC)
    beta = np.arcsin(spread(theta))
    normal = np.tile([0.0, 0.0, 1.0], (2, 1))
    to_center = np.tile([np.sin(beta), 0.0, np.cos(beta)], (2, 1))
    np.testing.assert_allclose(projection_error(d, normal, to_center, z, PC), epsilon)
