"""Where the sun stands, as words and as a direction."""

from __future__ import annotations

import json

import numpy as np
import pytest

from vegtool.errors import UsageError
from vegtool.lighting.light import Light, Sun
from vegtool.measure.views import direction


@pytest.mark.parametrize(
    ("text", "azimuth", "elevation"),
    [
        ("135,40", 135, 40),
        ("60.5,-12.25", 60.5, -12.25),
        ("-90, 0", 270, 0),
        ("725,-90", 5, -90),
        (" 0 , 90 ", 0, 90),
    ],
)
def test_a_sun_is_read_from_two_angles_and_any_azimuth_is_one_of_a_circle(
    text: str, azimuth: float, elevation: float
) -> None:
    assert Sun.read(text) == Sun(azimuth, elevation)


@pytest.mark.parametrize(
    "text",
    [
        "", "135", "1,2,3", "east,40", "10;20", "nan,40", "40,nan", "inf,10", "10,inf", "1,90.1",
        "1,-91",
    ],
)  # fmt: skip
def test_what_is_no_sun_is_refused_and_named(text: str) -> None:
    with pytest.raises(UsageError, match=r"--sun: .*azimuth") as caught:
        Sun.read(text)
    assert text in str(caught.value)
    with pytest.raises(UsageError, match="--light: "):
        Sun.read(text, "--light")


@pytest.mark.parametrize(
    ("sun", "axis"),
    [(Sun(0, 0), [0, 0, 1]), (Sun(90, 0), [1, 0, 0]), (Sun(77, 90), [0, 1, 0])],
)
def test_azimuth_runs_from_z_towards_x_and_elevation_up(sun: Sun, axis: list[float]) -> None:
    np.testing.assert_allclose(sun.direction, axis, atol=1e-15)


@pytest.mark.parametrize("azimuth", [0.0, 33.0, 210.0])
@pytest.mark.parametrize("elevation", [-90.0, -5.0, 0.0, 60.0, 90.0])
def test_a_sun_stands_where_a_camera_of_the_same_angles_does(
    azimuth: float, elevation: float
) -> None:
    found = Sun(azimuth, elevation).direction
    np.testing.assert_allclose(found, direction(azimuth, elevation), atol=1e-7)
    assert np.linalg.norm(found) == pytest.approx(1.0)


def test_below_the_horizon_there_is_the_sky_alone() -> None:
    above, at, below = (Sun(10, elevation).light for elevation in (1.0, 0.0, -0.5))
    assert above.sun == at.sun == Light().sun > 0
    assert below.sun == 0
    assert (below.sky_above, below.sky_below) == (Light().sky_above, Light().sky_below)


def test_a_light_has_a_direction_of_any_length() -> None:
    np.testing.assert_allclose(Light(np.array([0.0, 3.0, 4.0])).unit, [0, 0.6, 0.8])
    np.testing.assert_array_equal(
        Light(np.array([0.0, 3.0, 4.0])).unit, Light(np.array([0.0, 6.0, 8.0])).unit
    )


def test_a_manifest_can_state_it_and_says_how_bright_it_is() -> None:
    told = json.loads(json.dumps(Sun.read("60,-3").as_dict()))
    assert told == {
        "azimuth_deg": 60.0,
        "elevation_deg": -3.0,
        "sun": 0.0,
        "sky_above": Light().sky_above,
        "sky_below": Light().sky_below,
    }
