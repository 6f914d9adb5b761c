"""Foveation: how large surfels may be where, object by object."""

from __future__ import annotations

from math import atan, degrees, radians, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vegtool.preview.eye import Eye
from vegtool.preview.fovea import FACTOR, RADIUS, Fovea, factors
from vegtool.seeding import generator

EYE = Eye(np.array([3.0, 1.0, -2.0]), 30.0, -10.0)
WIDE, TALL = (800, 600), (300, 600)
ZONES = Fovea()


def seen_at(x: float, y: float, size: tuple[int, int], away_m: float = 10.0) -> np.ndarray:
    """(3,) metres from the eye of what is seen at a place in its picture, so far along its axis; x
    and y in halves of the picture's shorter side from its middle."""
    half = tan(radians(EYE.fov_y_deg) / 2) * min(size) / size[1]
    return away_m * (np.array([x * half, y * half, -1.0]) @ EYE.axes)


def points(*places: np.ndarray, size: tuple[int, int] = WIDE, fovea: Fovea = ZONES) -> list[float]:
    return factors(fovea, np.array(places), np.zeros(len(places)), EYE, size).tolist()


@pytest.mark.parametrize("size", [WIDE, TALL])
def test_zones_are_circles_of_the_shorter_side_and_between_them_it_is_straight(
    size: tuple[int, int],
) -> None:
    fovea = Fovea((0.2, 0.6, 1.0), (1.0, 1.5, 4.0))
    wanted = {0.0: 1.0, 0.2: 1.0, 0.4: 1.25, 0.6: 1.5, 0.8: 2.75, 1.0: 4.0, 1.4: 4.0}
    for turn in (0.0, 0.5, 2.0, 4.0):
        at = [seen_at(r * np.cos(turn), r * np.sin(turn), size) for r in wanted]
        assert points(*at, size=size, fovea=fovea) == pytest.approx(list(wanted.values()))


def test_it_goes_by_the_place_in_the_picture_and_not_by_the_distance() -> None:
    assert points(*(seen_at(0.5, 0.3, WIDE, away) for away in (0.2, 7.0, 5e3))) == pytest.approx(
        [points(seen_at(0.5, 0.3, WIDE))[0]] * 3
    )


def test_the_border_of_a_picture_is_the_last_zone() -> None:
    """Its shorter side is 1 by itself: where its planes are."""
    for size, normals in ((WIDE, EYE.planes(*WIDE)[2:4]), (TALL, EYE.planes(*TALL)[:2])):
        for normal, way in zip(normals, (-1.0, 1.0), strict=True):
            place = seen_at(*((0.0, way) if size == WIDE else (way, 0.0)), size)
            assert normal[:3] @ place == pytest.approx(0.0, abs=1e-9)
            assert points(place, size=size) == [pytest.approx(FACTOR[-1])]


def test_an_object_is_as_fine_as_what_of_it_is_nearest_to_the_middle() -> None:
    """A sphere of 5 degrees' half angle: where a point 5 degrees nearer to the middle is."""
    half = tan(radians(EYE.fov_y_deg) / 2)
    reach = 10.0 * np.sin(radians(5.0))
    for angle in (0.0, 3.0, 12.0, 25.0, 60.0):
        way = np.array([np.sin(radians(angle)), 0.0, -np.cos(radians(angle))])
        near = points(seen_at(tan(radians(max(angle - 5.0, 0.0))) / half, 0.0, WIDE))
        found = factors(ZONES, (10.0 * way @ EYE.axes)[None], np.array([reach]), EYE, WIDE)
        assert found.tolist() == pytest.approx(near)


def test_an_object_that_the_eye_is_in_is_fine_and_what_is_behind_it_is_not() -> None:
    behind = 4.0 * EYE.axes[2]
    places = np.array([behind, behind, np.zeros(3), behind])
    found = factors(ZONES, places, np.array([4.5, 4.0, 0.0, 0.1]), EYE, WIDE)
    assert found.tolist() == [FACTOR[0], FACTOR[0], FACTOR[0], FACTOR[-1]]
    assert factors(ZONES, np.zeros((0, 3)), np.zeros(0), EYE, WIDE).shape == (0,)


def test_larger_objects_are_no_coarser() -> None:
    random = generator(0, "fovea")
    place, reach = random.normal(size=(500, 3)), random.uniform(0, 2, 500)
    small, large = (factors(ZONES, place, one, EYE, WIDE) for one in (reach, 1.2 * reach))
    assert (large <= small + 1e-12).all() and np.ptp(small) == pytest.approx(1.0)


def test_the_default_is_what_a_lens_leaves_of_a_pixel() -> None:
    """What the picture has at r (1 + 0.22 r^2 + 0.24 r^4) of 1.46 is shown at r: an area of it is
    pressed together by the product of both directions' slopes, so a length by its root."""
    shown = np.linspace(0, 1, 201)
    across = 1 + 0.22 * shown**2 + 0.24 * shown**4
    along = 1 + 3 * 0.22 * shown**2 + 5 * 0.24 * shown**4
    radius, pressed = shown * across / across[-1], np.sqrt(across * along)
    wanted = np.interp(radius, RADIUS, FACTOR)
    assert np.abs(wanted / pressed - 1).max() < 0.07
    assert pressed[-1] == pytest.approx(2.04, abs=0.01)
    assert degrees(atan(tan(radians(30)) * RADIUS[0])) > 8, "all that an eye sees sharply, and more"


@pytest.mark.parametrize(
    ("radius", "factor"),
    [((), ()), ((0.5,), (1.0, 2.0)), ((-0.1, 1.0), (1.0, 2.0)), ((0.5, 0.5), (1.0, 2.0)),
     ((0.5, np.nan), (1.0, 2.0)), ((0.2, 1.0), (0.9, 2.0)), ((0.2, 1.0), (1.0, np.inf)),
     ((0.2, 1.0), (1.0, np.nan))],
)  # fmt: skip
def test_zones_that_are_none_are_refused(
    radius: tuple[float, ...], factor: tuple[float, ...]
) -> None:
    with pytest.raises(ValueError, match=r"^Fovea"):
        Fovea(radius, factor)


@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3), st.floats(0, 1e6))
def test_anything_anywhere_has_a_factor_of_the_zones(place: list[float], reach: float) -> None:
    (found,) = factors(ZONES, np.array([place]), np.array([reach]), EYE, WIDE)
    assert FACTOR[0] <= found <= FACTOR[-1]
