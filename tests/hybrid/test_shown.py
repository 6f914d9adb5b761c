"""Of how many viewers a billboard shows a face, beside a numeric integral."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.hybrid.shown import pictured, seen, shown_fraction
from vegtool.stability.plants import sphere_points

UP = np.array([[0.0, 0.0, 1.0]])


def leaning(degrees: float, turn: float = 0.0) -> np.ndarray:
    """(1, 3) a unit vector so far from UP."""
    a = np.radians(degrees)
    return np.array([[np.sin(a) * np.cos(turn), np.sin(a) * np.sin(turn), np.cos(a)]])


def integral(face: np.ndarray, planes: np.ndarray) -> float:
    """Of what is seen of a face over the sphere, the share that its pictures on planes show."""
    viewers = sphere_points(200_000)
    wanted = np.abs(viewers @ face[0])
    shown = sum(abs(float(face[0] @ plane)) * np.abs(viewers @ plane) for plane in planes)
    return float(np.minimum(wanted, shown).sum() / wanted.sum())


def fraction(face: np.ndarray, planes: np.ndarray) -> float:
    pictures = pictured(np.repeat(face, len(planes), axis=0), planes).sum(axis=0)
    return float(shown_fraction(face, pictures[None])[0])


@pytest.mark.parametrize("normal", [UP, -UP, leaning(77, 2)])
def test_a_face_on_its_own_plane_is_shown_to_all(normal: np.ndarray) -> None:
    assert fraction(normal, normal) == 1.0
    assert fraction(normal, -normal) == 1.0
    assert fraction(normal, np.concatenate([normal, normal])) == 1.0  # not more than all


def test_a_face_across_its_plane_is_shown_to_none() -> None:
    assert fraction(UP, leaning(90)) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5])
@pytest.mark.parametrize("degrees", [10, 45, 80])
def test_a_face_that_leans_beside_an_integral(degrees: float, turn: float) -> None:
    """64 viewers stand for all: within 0.03."""
    plane = leaning(degrees, turn)
    assert fraction(UP, plane) == pytest.approx(integral(UP, plane), abs=0.03)


def test_two_planes_patch_what_one_leaves() -> None:
    """Both lean by 45 degrees, to either side."""
    both = np.concatenate([leaning(45), leaning(-45)])
    one, two = fraction(UP, both[:1]), fraction(UP, both)
    assert two == pytest.approx(integral(UP, both), abs=0.03)
    assert two > one + 0.2


def test_a_face_without_a_normal_needs_nothing() -> None:
    nothing = np.zeros((1, 3))
    assert seen(nothing).max() == 0
    assert fraction(nothing, UP) == 1.0
