"""Camera paths: what is read, what is refused and where, and where the eye is at every frame."""

from __future__ import annotations

from itertools import pairwise
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vegtool.arrays import FloatArray
from vegtool.camera_path.curve import through
from vegtool.camera_path.file import KEYS, STATION, CameraPath, Station, read_path, written
from vegtool.errors import UsageError
from vegtool.preview.eye import Eye
from vegtool.preview.path import MOST_FRAMES, duration_s, eyes, recorded
from vegtool.scene import KINDS

PAGE = Path(__file__).parent.parent.parent / "docs" / "camera_path.md"
WHOLE = """\
# round the barn
fps = 25
loop = true
fov_y_deg = 50
height_m = 2
speed_m_s = 3

[[station]]
position = [0, 0]
yaw_deg = 180
pitch_deg = -5.5
time_s = 1

[[station]]
position = [10, 0]
height_m = 1.5
look_at = [5, 1, 5]
speed_m_s = 1

[[station]]
position = [10, 4, 10]
time_s = 20
"""


def read(folder: Path, text: str) -> CameraPath:
    path = folder / "path.toml"
    path.write_text(text, encoding="utf-8")
    return read_path(path)


def refusal(folder: Path, text: str) -> str:
    """What is said of a path that is refused, read or walked, less its folder."""
    with pytest.raises(UsageError) as caught:
        eyes(read(folder, text))
    return str(caught.value).replace(str(folder / "path.toml"), "FILE")


def station(x: float, y: float = 0.0, z: float = 0.0, **others: object) -> Station:
    return Station((x, y, z), **others)  # type: ignore[arg-type]


def walk(*stations: Station, **others: object) -> CameraPath:
    return CameraPath(stations, **{"fps": 10.0, "speed_m_s": 1.0, **others})  # type: ignore[arg-type]


def positions(path: CameraPath, fps: float | None = None) -> FloatArray:
    return np.array([eye.position for eye in eyes(path, fps)])


def test_a_whole_file_is_read(tmp_path: Path) -> None:
    path = read(tmp_path, WHOLE)
    assert (path.fps, path.loop, path.fov_y_deg, path.speed_m_s) == (25, True, 50, 3)
    assert path.stations == (
        Station((0, 2, 0), True, 180, -5.5, time_s=1),
        Station((10, 1.5, 0), True, look_at=(5, 1, 5), speed_m_s=1),
        Station((10, 4, 10), time_s=20),
    )


def test_what_is_written_is_read_again_to_the_last_digit(tmp_path: Path) -> None:
    path = read(tmp_path, WHOLE)
    assert read(tmp_path, written(path)) == path
    odd = walk(station(0.1, 1e-17, -1e8, yaw_deg=1 / 3), station(1e-300, time_s=1e8 + 1 / 3))
    assert read(tmp_path, written(odd)) == odd


def test_the_page_describes_every_key_as_it_is() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for key, rule in (KEYS | STATION).items():
        row = f"| `{key}` | {KINDS[rule.kind][0]} |"
        assert row in text, f"{key} is not on the page, or is another thing there"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("fps = 0", "FILE, line 1: fps: expected at least 0.01; got 0"),
        ("fps = nan", "FILE, line 1: fps: expected a number; got nan"),
        ("speed = 2", "FILE, line 1: no key of a path is called 'speed'; known: fps, loop,"),
        ("fps = 25", "FILE: expected one [[station]] at least; got none"),
        ("station = 3", "FILE, line 1: expected tables [[station]]"),
        ("[[station]]\nyaw_deg = 1", "FILE, line 1: expected position in [[station]], [x, y, z]"),
        ("[[station]]\nposition = [1]", "FILE, line 2: position: expected [x, y, z], or [x, z]"),
        ("[[station]]\nposition = [1, nan]", "FILE, line 2: position: expected [x, y, z], or"),
        ("[[station]]\nposition = [1, 2e9]", "FILE, line 2: position: expected at most 1e+09;"),
        (
            "[[station]]\nposition = [1, 2]\nyaw = 3",
            "FILE, line 3: no key of [[station]] is called 'yaw'; known: position, height_m,",
        ),
        (
            "[[station]]\nposition = [1, 2]\npitch_deg = 91",
            "FILE, line 3: pitch_deg: expected at most 90; got 91",
        ),
        (
            "[[station]]\nposition = [1, 2]\ntime_s = -1",
            "FILE, line 3: time_s: expected at least 0; got -1",
        ),
        (
            "[[station]]\nposition = [1, 2, 3]\nheight_m = 4",
            "FILE, line 3: height_m goes with a position [x, z] alone;",
        ),
        (
            "[[station]]\nposition = [1, 2]\nyaw_deg = 4\nlook_at = [0, 0, 0]",
            "FILE, line 3: look_at says it already; leave out one of the two",
        ),
        (
            "[[station]]\nposition = [1, 2]\nspeed_m_s = 4",
            "FILE, line 3: speed_m_s is that of the way to a station, and none leads to the first",
        ),
        (
            "[[station]]\nposition = [1, 2]\n[[station]]\nposition = [1, 3]\n"
            "time_s = 4\nspeed_m_s = 2",
            "FILE, line 6: time_s says it already; leave out one of the two",
        ),
        (
            "[[station]]\nposition = [1, 2]\ntime_s = 4\n"
            "[[station]]\nposition = [1, 3]\ntime_s = 4",
            "FILE, line 6: time_s: expected more than 4, as before; got 4",
        ),
        (
            "[[station]]\nposition = [0, 0]\n[[station]]\nposition = [14, 0]\n"
            "[[station]]\nposition = [14, 9]\ntime_s = 10",
            "FILE, line 7: time_s: expected more than ",  # 14 m at 1.4 m/s alone take 10 s
        ),
        (
            "[[station]]\nposition = [1, 2, 3]\nlook_at = [1, 2, 3]",
            "FILE, line 3: look_at: expected a point away from the eye; got the station's own",
        ),
        (
            "speed_m_s = 0.001\n[[station]]\nposition = [0, 0]\n[[station]]\nposition = [1e6, 0]",
            f"FILE: expected at most {MOST_FRAMES:,} frames; 1e+09 s at 30 frames per second are ",
        ),
        ("[[station]\n", "FILE: expected TOML; "),
    ],
)
def test_what_is_wrong_is_said_with_its_line(tmp_path: Path, text: str, says: str) -> None:
    assert refusal(tmp_path, text).startswith(says)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot read this path"):
        read_path(tmp_path / "none.toml")


def test_one_station_is_one_frame() -> None:
    for loop in (False, True):
        (eye,) = eyes(walk(station(1, 2, 3, yaw_deg=40, pitch_deg=-90), loop=loop))
        assert (eye.position.tolist(), eye.yaw_deg, eye.pitch_deg) == ([1, 2, 3], 40, -90)
        assert duration_s(walk(station(1), loop=loop)) == 0


def test_two_equal_stations_are_one_frame_too() -> None:
    path = walk(station(1), station(1), station(1))
    assert len(eyes(path)) == 1
    assert len(eyes(walk(station(1), station(1), loop=True))) == 1


def test_two_stations_are_joined_by_a_straight_line_at_their_speed() -> None:
    """3 m at 1 m/s, ten frames a second: 31 frames, the last one at the last station."""
    found = positions(walk(station(0), station(3)))
    np.testing.assert_allclose(found, np.outer(np.arange(31) / 10, [1, 0, 0]), atol=1e-12)


def test_the_last_frame_is_the_last_station_however_long_a_frame_is() -> None:
    found = positions(walk(station(0), station(3)), fps=0.4)
    np.testing.assert_allclose(found[:, 0], [0, 2.5, 3])


def test_a_loop_does_not_show_its_first_station_twice() -> None:
    path = walk(station(0), station(3), loop=True)
    found = positions(path)
    assert len(found) == 60
    np.testing.assert_allclose(found[30], [3, 0, 0], atol=1e-12)
    assert duration_s(path) == pytest.approx(6)


def pyramid(points: FloatArray, fraction: float) -> FloatArray:
    """Barry and Goldman's way to a point between the second and the third of four: by knots."""
    knots = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1) ** 0.5)])
    t = knots[1] + fraction * (knots[2] - knots[1])
    level = list(points)
    for width in (1, 2):
        level = [
            ((knots[i + width] - t) * a + (t - knots[i]) * b) / (knots[i + width] - knots[i])
            for i, (a, b) in enumerate(pairwise(level))
        ]
    a, b = level
    return np.asarray(((knots[2] - t) * a + (t - knots[1]) * b) / (knots[2] - knots[1]))


def test_the_curve_is_catmull_and_roms() -> None:
    """Against the recursion of Barry and Goldman (1988), which has no slopes in it."""
    points = np.random.default_rng(2).normal(size=(4, 3)) * [1, 10, 100]
    curve = through(points)
    for fraction in (0.0, 0.1, 0.5, 0.9, 1.0):
        found = curve.at(np.array([1]), np.array([fraction]), points)[0]
        np.testing.assert_allclose(found, pyramid(points, fraction), atol=1e-12)


def test_speed_is_constant_between_stations() -> None:
    """Corners, a station near another one and one far away: frames are a step apart, or less by
    how much the way between them is bent."""
    corners = [(0, 0, 0), (10, 0, 0), (10, 0, 10), (10.1, 0, 10), (40, 5, 0)]
    path = walk(*(station(*corner, yaw_deg=0.0) for corner in corners))
    steps = np.linalg.norm(np.diff(positions(path, fps=100), axis=0), axis=1)[:-1]
    assert steps.max() < 0.01 * 1.005
    assert np.percentile(steps, 2) > 0.01 * 0.99
    assert duration_s(path) == pytest.approx(steps.sum(), abs=0.02)


def test_times_are_kept_to() -> None:
    path = walk(station(0), station(1, time_s=5), station(11, speed_m_s=2), station(11, time_s=20))
    found = positions(path)
    np.testing.assert_allclose(found[50, 0], 1, atol=1e-9)
    np.testing.assert_allclose(found[100, 0], 11, atol=1e-9)
    assert len(found) == 201, "the eye waits at the end"


def test_a_path_may_begin_late() -> None:
    """As one does whose beginning was cut off."""
    path = walk(station(0, time_s=7), station(2, time_s=9))
    np.testing.assert_allclose(positions(path)[:, 0], np.arange(21) / 10, atol=1e-12)


def test_without_a_direction_the_eye_looks_along_the_path() -> None:
    path = walk(station(0), station(0, 0, -5), station(-5, 3, -5))
    yaw = [eye.yaw_deg for eye in eyes(path)]
    assert yaw[0] == pytest.approx(0) and yaw[-1] == pytest.approx(90)
    assert {eye.pitch_deg for eye in eyes(path)} == {0.0}, "level"
    assert (np.diff(yaw) >= -1e-9).all()


def test_back_the_way_it_came() -> None:
    """At a turn of 180 degrees the curve has no direction: the eye looks on, then turns round."""
    path = walk(station(0), station(0, 0, -5), station(0, 0, 0))
    found = eyes(path)
    at = np.array([eye.position for eye in found])
    assert np.abs(at[:, :2]).max() < 1e-9, "it leaves the line nowhere"
    assert found[50].position[2] == pytest.approx(-5)
    assert found[50].yaw_deg == pytest.approx(0) and abs(found[-1].yaw_deg) == pytest.approx(180)


@pytest.mark.parametrize(
    ("first", "second", "middle"),
    [(10, 350, 0), (350, 10, 360), (-170, 170, -180), (0, 180, 90), (180, 0, 270), (0, 720, 0)],
)
def test_the_eye_turns_the_shortest_way(first: float, second: float, middle: float) -> None:
    """Of two ways alike, to the left."""
    found = eyes(walk(station(0, yaw_deg=first), station(4, yaw_deg=second)))
    assert found[20].yaw_deg == pytest.approx(middle)


def test_on_the_spot_the_eye_turns_in_its_own_time() -> None:
    """90 degrees, at 180 in a second, where no way says how long that takes."""
    path = walk(station(1, yaw_deg=0), station(1, yaw_deg=90))
    assert duration_s(path) == pytest.approx(0.5)
    assert eyes(path)[-1].yaw_deg == pytest.approx(90)


def test_pitch_does_not_go_over_the_top() -> None:
    """Straight up thrice: interpolation that swings out would pass 90 degrees."""
    pitches = [0, 90, 90, -90, 90, 0, 60]
    path = walk(*(station(i, pitch_deg=p) for i, p in enumerate(pitches)))
    found = np.array([eye.pitch_deg for eye in eyes(path, fps=50)])
    assert found.max() == 90 and found.min() == -90
    between = found[np.array([i for i in range(len(found)) if 50 < i < 100])]
    assert (between == 90).all(), "between two alike it stays"


def test_a_loop_is_as_smooth_at_its_first_station_as_elsewhere() -> None:
    """A square, whose middles of sides are stations too: a quarter of it later, the eye is where it
    was, but for a quarter turn, its way over the first station included."""
    corners = [(-1, -1), (-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1)]
    yaws = [30.0, 50.0]  # at a corner and beside it, before the quarter turns
    path = walk(
        *(station(x, 0, z, yaw_deg=yaws[i % 2] + i // 2 * 90) for i, (x, z) in enumerate(corners)),
        loop=True,
    )
    found = eyes(path, fps=800 / duration_s(path))
    assert len(found) == 800
    at, yaw = np.array([eye.position for eye in found]), np.array([eye.yaw_deg for eye in found])
    np.testing.assert_allclose(yaw[200:] - yaw[:-200], 90, atol=1e-9)
    np.testing.assert_allclose(at[200:, 0], at[:-200, 2], atol=1e-9)
    np.testing.assert_allclose(at[200:, 2], -at[:-200, 0], atol=1e-9)


def test_the_eye_keeps_above_the_ground() -> None:
    """Between stations above the ground, hills are gone over; between others, through."""

    def hill(x: float, z: float) -> float:
        return 5.0 if 4 < x < 6 else 0.0

    above = walk(station(0, 1.5, above_ground=True), station(10, 1.5, above_ground=True))
    for eye in eyes(above, ground=hill):
        assert eye.position[1] == pytest.approx(hill(eye.position[0], 0) + 1.5)
    free = walk(station(0, 1.5), station(10, 1.5))
    assert [eye.position[1] for eye in eyes(free, ground=hill)] == pytest.approx([1.5] * 101)
    mixed = eyes(walk(station(0, 1.5, above_ground=True), station(10, 1.5)), ground=hill)
    assert mixed[50].position[1] == pytest.approx(1.5 + 5 / 2), "half of it half way"
    assert eyes(above)[50].position[1] == pytest.approx(1.5), "without a ground, above 0"


def test_thousands_of_stations_are_a_path() -> None:
    """Round and round a circle: the eye stays on it."""
    angle = np.linspace(0, 20 * np.pi, 5001)[:-1]
    ring = [station(100 * np.cos(a), 2, 100 * np.sin(a)) for a in angle.tolist()]
    path = walk(*ring, loop=True, speed_m_s=100.0)
    at = positions(path)
    np.testing.assert_allclose(np.hypot(at[:, 0], at[:, 2]), 100, atol=1e-3)
    assert duration_s(path) == pytest.approx(20 * np.pi, rel=1e-5)


@pytest.mark.parametrize("fps", [0, -1, nan, inf])
def test_frames_per_second_that_are_none_are_refused(fps: float) -> None:
    with pytest.raises(ValueError, match="frames per second"):
        eyes(walk(station(0)), fps)


def test_a_path_without_a_file_names_its_stations() -> None:
    with pytest.raises(UsageError, match=r"^station 2: look_at"):
        eyes(walk(station(0), station(1, look_at=(1.0, 0.0, 0.0))))
    with pytest.raises(ValueError, match="one at least"):
        CameraPath(())


def test_a_recorded_walk_is_walked_again(tmp_path: Path) -> None:
    """With a station for each frame, frame by frame; with fewer, near to it."""
    time_s = 3 + np.arange(101) / 20
    seen = [
        Eye(np.array([np.cos(t), 1.7, np.sin(t)]), 60 * t % 360, 20 * np.sin(t), 50)
        for t in time_s.tolist()
    ]
    path = recorded(seen, time_s.tolist(), fps=20, every_s=0)
    again = eyes(read(tmp_path, written(path)))
    assert len(path.stations) == len(again) == 101
    for was, eye in zip(seen, again, strict=True):
        np.testing.assert_allclose(eye.position, was.position, atol=1e-9)
        np.testing.assert_allclose(eye.axes, was.axes, atol=1e-9)
        assert eye.fov_y_deg == 50
    few = recorded(seen, time_s.tolist(), fps=20)
    assert len(few.stations) == 11
    apart = [np.linalg.norm(a.position - b.position) for a, b in zip(eyes(few), seen, strict=True)]
    assert max(apart) < 0.02


def test_what_cannot_be_recorded_is_refused() -> None:
    eye = Eye(np.zeros(3))
    for times in ([0.0, 0.0], [1.0, 0.5], [0.0, nan], [0.0]):
        with pytest.raises(ValueError, match=r"^recorded"):
            recorded([eye, eye], times)
    with pytest.raises(ValueError, match=r"^recorded"):
        recorded([], [])
    assert len(eyes(recorded([eye], [5.0]))) == 1


@pytest.mark.parametrize("pitch", [7e-189, 1e-13, 1e-300])
@pytest.mark.parametrize("others", [0, 1])
def test_a_turn_of_next_to_nothing_takes_no_time(pitch: float, others: int) -> None:
    """Back and forth, at the same place: slopes that no number can say are none."""
    stations = [Station((1.0, 1.0, 0.0)), Station((1.0, 1.0, 0.0), pitch_deg=pitch)]
    stations += [Station((0.0, 0.0, 0.0))] * others
    path = CameraPath(tuple(stations), loop=True, speed_m_s=1e5)
    found = eyes(path, fps=1000 / max(duration_s(path), 1e-6))
    np.testing.assert_array_equal(found[0].position, [1, 1, 0])
    assert all(abs(eye.pitch_deg) <= 90 for eye in found)


NUMBERS = st.floats(-1e6, 1e6) | st.sampled_from([0.0, 1.0, 1.0, 1e-9, 1e6])


@given(
    st.lists(
        st.builds(
            Station,
            st.tuples(NUMBERS, NUMBERS, NUMBERS),
            st.booleans(),
            st.none() | st.floats(-1e4, 1e4),
            st.none() | st.floats(-90, 90),
        ),
        min_size=1,
        max_size=6,
    ),
    st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_whatever_the_stations_the_eye_passes_them_without_a_jump(
    stations: list[Station], loop: bool
) -> None:
    """At 1000 frames for the whole way none is farther from the next than a thousandth of it."""
    path = CameraPath(tuple(stations), loop=loop, speed_m_s=1e5)
    duration = duration_s(path)
    found = eyes(path, fps=1000 / max(duration, 1e-6))
    at = np.array([eye.position for eye in found])
    steps = np.linalg.norm(np.diff(at, axis=0), axis=1)
    size = 1 + np.abs(at).max()
    assert steps.max(initial=0) <= 1e5 * duration / 1000 * 1.05 + 1e-9 * size
    np.testing.assert_allclose(at[0], path.stations[0].position, atol=1e-9 * size)
    if not loop:
        np.testing.assert_allclose(at[-1], path.stations[-1].position, atol=1e-9 * size)
