"""Where eyes may be: what is said of them, against eyes at random, and by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from needs_cases import FLAT, hills, scene_with, standing, stations

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.needs.floor import Floor
from vegtool.needs.inside import inside
from vegtool.needs.viewers import Viewers, display_of, viewers_of
from vegtool.seeding import generator
from vegtool.tiles.terrain import Terrain

SQUARE = "polygon = [[-10, -10], [10, -10], [10, 10], [-10, 10]]"
HOOK = "polygon = [[-30, -20], [30, -20], [30, 25], [20, 25], [20, -10], [-30, -10]]"
BEND = stations("position = [-30, 0]", "position = [0, 12]", "position = [5, -20]")
FLIGHT = stations(
    "position = [-30, 112, -30]", "position = [0, 130, 0]", "position = [30, -10]\nheight_m = 4"
)
LOOP = stations("position = [-20, 0]", "position = [0, 15]", "position = [20, 0]", head="loop=true")
SPOT = stations("position = [3, 4]")
CASES = {
    "a square": (SQUARE + "\nheight_m = [1, 2]", None),
    "a hook with a margin": (HOOK + "\nheight_m = [1, 30]\nmargin_m = 3", None),
    "at any height": (SQUARE, None),
    "everywhere": ("height_m = [1, 2]", None),
    "a path": ("", BEND),
    "a path with a margin": ("margin_m = 2\nheight_m = [1, 3]", BEND),
    "a flight": ("", FLIGHT),
    "a flight with a margin": ("margin_m = 6", FLIGHT),
    "a loop": ("margin_m = 1", LOOP),
    "a place": ("", SPOT),
    "about a place": ("margin_m = 2", SPOT),
}
FLIGHTS = ("a flight", "a flight with a margin")
"""Over the hills, at heights of their own."""
STEEPEST = 0.8
"""Metres that hills() rise by a metre at most."""
GROUNDS = {"flat": FLAT, "hills": hills()}


def viewers(folder: Path, camera: str, path: str | None = None, ground: Terrain = FLAT) -> Viewers:
    return viewers_of(scene_with(folder, camera, path), ground)


def around(ground: Terrain) -> FloatArray:
    """Points near and far, low and high, about the viewers."""
    random = generator(1, "points")
    xz = np.concatenate([random.uniform(-40, 40, (60, 2)), random.uniform(-300, 300, (20, 2))])
    y = ground.height(xz) + random.uniform(0, 15, len(xz))
    return np.stack([xz[:, 0], y, xz[:, 1]], axis=1)


def angles(points: FloatArray, eyes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n, m) distances, azimuths and elevations of eyes from points."""
    x, y, z = np.moveaxis(eyes[None] - points[:, None], 2, 0)
    flat = np.hypot(x, z)
    return np.hypot(flat, y), np.arctan2(x, z), np.arctan2(y, flat)


@pytest.mark.parametrize(
    ("case", "ground"), [(a, b) for a in CASES for b in GROUNDS if b == "hills" or a not in FLIGHTS]
)
def test_no_eye_is_nearer_farther_or_elsewhere(tmp_path: Path, case: str, ground: str) -> None:
    floor = GROUNDS[ground]
    there = viewers(tmp_path, *CASES[case], floor)
    points, radius = around(floor), generator(2, "radius").uniform(0, 4, 80)
    eyes = inside(there, 3000, 0).position
    away, azimuth, elevation = angles(points, eyes)
    assert (there.nearest(points) <= away.min(axis=1) + 1e-6).all()
    ball = there.nearest(points, radius)
    assert (ball <= np.maximum(away.min(axis=1) - radius, 0) + 1e-6).all() and (ball >= 0).all()
    assert (there.farthest(points) >= away.max(axis=1) - 1e-6).all()
    seen = there.directions(points, radius)
    assert (elevation >= seen.low[:, None] - 1e-7).all()
    assert (elevation <= seen.high[:, None] + 1e-7).all()
    turned = (azimuth - seen.start[:, None] + 1e-7) % (2 * np.pi)
    assert (turned <= seen.extent[:, None] + 2e-7).all()


@pytest.mark.parametrize("case", CASES)
def test_bounds_are_tight(tmp_path: Path, case: str) -> None:
    """On steep hills, to 5 % and 0.75 m of what 10,000 eyes come to, which leave out a part of it
    too, and what the ground rises within the smallest squares, or the margin of a path."""
    floor = hills()
    there = viewers(tmp_path, *CASES[case], floor)
    points = around(floor)
    _check_tight(there, points, inside(there, 10_000, 0).position, case == "at any height")


def _check_tight(there: Viewers, points: FloatArray, eyes: FloatArray, any_height: bool) -> None:
    away, _, elevation = angles(points, eyes)
    near, far = away.min(axis=1), away.max(axis=1)
    slack = 0.75 + 2 * STEEPEST * float(there.cells.radius.max())
    assert (there.nearest(points) >= 0.95 * near - slack).all()
    seen, wide = there.directions(points), np.arcsin(np.minimum(0.05 + slack / near, 1))
    outside = near > 4
    assert (seen.low >= elevation.min(axis=1) - wide)[outside].all()
    if not any_height:
        assert (there.farthest(points) <= 1.05 * far + slack).all()
        assert (seen.high <= elevation.max(axis=1) + wide)[outside].all()


def test_a_square_by_hand(tmp_path: Path) -> None:
    """Eyes at 1 to 2 m on 20 x 20 m; a point 20 m beside it, at 5 m."""
    there = viewers(tmp_path, SQUARE + "\nheight_m = [1, 2]")
    point = np.array([[30.0, 5.0, 0.0]])
    assert there.nearest(point) == pytest.approx(np.hypot(20, 3))
    assert there.nearest(point, 4.0) == pytest.approx(np.hypot(20, 3) - 4)
    assert there.farthest(point) == pytest.approx(np.hypot(np.hypot(40, 10), 4))
    seen = there.directions(point)
    assert seen.extent == pytest.approx(2 * np.arctan(10 / 20), abs=1e-6)
    assert seen.start == pytest.approx(1.5 * np.pi - np.arctan(10 / 20), abs=1e-6)  # towards -x
    assert seen.low == pytest.approx(np.arctan2(-4, 20))
    assert seen.high == pytest.approx(np.arctan2(-3, np.hypot(40, 10)))


def test_a_margin_is_a_circle_about_each_corner(tmp_path: Path) -> None:
    """A point on the diagonal is as much nearer as the margin is, not root two times as much."""
    point = np.array([[20.0, 1.5, 20.0]])
    plain = viewers(tmp_path, SQUARE + "\nheight_m = [1, 2]").nearest(point)
    wide = viewers(tmp_path, SQUARE + "\nheight_m = [1, 2]\nmargin_m = 5").nearest(point)
    assert plain == pytest.approx(np.hypot(10, 10)) and wide == pytest.approx(plain - 5)


def test_seen_from_within_a_hook(tmp_path: Path) -> None:
    """From the pocket of a U, eyes are on three sides: exactly the arc that its corners leave."""
    there = viewers(
        tmp_path,
        "polygon = [[-9, -9], [9, -9], [9, 9], [8, 9], [8, -8], [-8, -8], [-8, 9], [-9, 9]]\n"
        "height_m = [1, 1]",
    )
    seen = there.directions(np.array([[0.0, 1.0, 0.0]]))
    assert seen.extent == pytest.approx(2 * np.pi - 2 * np.arctan(8 / 9), abs=1e-6)


def test_a_ceiling(tmp_path: Path) -> None:
    """Eyes at 1 to 9 m: those above 4 m do not count; where all would be above, all count."""
    there = viewers(tmp_path, SQUARE + "\nheight_m = [1, 9]")
    points = np.array([[30.0, 2.0, 0.0], [30.0, 0.2, 0.0]])
    seen = there.directions(points, 0.0, np.array([4.0, 0.5]))
    assert seen.high[0] == pytest.approx(np.arctan2(4 - 2, 20))
    assert seen.high[1] == pytest.approx(np.arctan2(9 - 0.2, 20))


@pytest.mark.parametrize("turn", [0.3, 2.0, np.pi / 2])
@pytest.mark.parametrize("path", [None, BEND])
def test_what_is_turned_and_moved(tmp_path: Path, turn: float, path: str | None) -> None:
    """A scene turned about y and moved is seen the same, from directions turned as much."""

    def turned(xz: FloatArray) -> FloatArray:
        x, z = xz.T
        s, c = np.sin(turn), np.cos(turn)
        return np.stack([c * x + s * z + 40, c * z - s * x - 70], axis=1)

    flat = np.array([[-30.0, 0], [0, 12], [5, -20]])
    points = around(FLAT)
    moved = points.copy()
    moved[:, [0, 2]] = turned(points[:, [0, 2]])
    found = []
    for corners, each in ((flat, points), (turned(flat), moved)):
        if path is None:
            camera, way = f"polygon = {corners.tolist()}\nheight_m = [1, 2]\nmargin_m = 1", None
        else:
            camera = "margin_m = 1"
            way = stations(*(f"position = {corner}" for corner in corners.tolist()))
        there = viewers(tmp_path, camera, way)
        found.append((there.nearest(each), there.farthest(each), there.directions(each)))
    (near, far, seen), (near_too, far_too, seen_too) = found
    assert near == pytest.approx(near_too, abs=1e-6) and far == pytest.approx(far_too, abs=1e-6)
    assert seen.low == pytest.approx(seen_too.low, abs=1e-6)
    assert seen.high == pytest.approx(seen_too.high, abs=1e-6)
    assert seen.extent == pytest.approx(seen_too.extent, abs=1e-6)
    known = seen.extent < 6
    off = (seen.start + turn - seen_too.start + np.pi) % (2 * np.pi) - np.pi
    assert known.any() and off[known] == pytest.approx(0, abs=1e-6)


def test_the_same_seed_the_same_eyes(tmp_path: Path) -> None:
    there = viewers(tmp_path, SQUARE + "\nheight_m = [1, 2]")
    one, same, other = (inside(there, 10, seed) for seed in (1, 1, 2))
    assert (one.position == same.position).all() and (one.pitch_deg == same.pitch_deg).all()
    assert len(one) == 10 and (one.position != other.position).any()


def test_plants_without_ground(tmp_path: Path) -> None:
    """Where plants stand at heights of their own, eyes are above those."""
    plants = standing([[-5, 400, 0], [5, 410, 3]])
    scene = scene_with(tmp_path, "height_m = [1, 2]")
    there = viewers_of(scene, Terrain(), plants)
    assert (there.cells.low == 401).all() and (there.cells.high == 412).all()
    assert np.ptp(there.outline, axis=0).tolist() == [10, 3]
    assert "all over its 10 x 3 m" in there.notes[0]
    assert (np.abs(inside(there, 50, 0).position[:, 1] - 406.5) <= 5.5).all()
    with pytest.raises(ValueError, match="expected ground with an extent"):
        viewers_of(scene, Terrain())


def test_notes(tmp_path: Path) -> None:
    said = viewers(tmp_path, "").notes
    assert "no path and no polygon" in said[0] and "no height_m" in said[1]
    assert viewers(tmp_path, SQUARE + "\nheight_m = [1, 2]").notes == ()


def test_the_display(tmp_path: Path) -> None:
    """Of two fields of view the narrower one: it shows plants larger."""
    scene = scene_with(tmp_path, "fov_y_deg = 50\nimage_height_px = 720", SPOT)
    shown = display_of(scene, viewers_of(scene, FLAT))
    assert (shown.fov_y_deg, shown.image_height_px) == (50, 720)
    scene = scene_with(tmp_path, "fov_y_deg = 50", "fov_y_deg = 30\n" + SPOT)
    shown = display_of(scene, viewers_of(scene, FLAT))
    assert (shown.fov_y_deg, shown.image_height_px) == (30, 1080)


UNDER = stations("position = [0, 95, 0]\nyaw_deg = 0", "position = [10, 130, 0]")
THROUGH = stations("position = [-36, 105, 0]", "position = [36, 105, 0]")


@pytest.mark.parametrize(
    ("camera", "path", "says"),
    [
        (SQUARE, SPOT, "scene.toml, line 3: expected a path or a polygon; got both"),
        ("", UNDER, "path.toml, line 3: position: station 1, at 0, 0, is 5 m under the ground"),
        ("", THROUGH, "path.toml, line 3: after station 1, at about"),
        ("", stations("position = [0, 0]\nheight_m = -1"), "line 3: position: station 1"),
        ("polygon = [[0, 0], [50, 0], [0, 9]]", None, "line 2: polygon: expected corners on the"),
    ],
)
def test_contradictions(tmp_path: Path, camera: str, path: str | None, says: str) -> None:
    with pytest.raises(UsageError) as caught:
        viewers(tmp_path, camera, path, hills())
    assert says in str(caught.value)


def test_beyond_a_plane_is_more_of_it(tmp_path: Path) -> None:
    """A backdrop is looked at from beside it."""
    there = viewers(tmp_path, "polygon = [[500, 0], [510, 0], [500, 9]]\nheight_m = [1, 2]")
    assert there.nearest(np.zeros((1, 3))) == pytest.approx(np.hypot(500, 1))


def test_many_points_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left out of cells, and cut into parts, changes nothing."""
    there = viewers(tmp_path, HOOK + "\nheight_m = [1, 30]", None, hills())
    points = around(hills())
    near, far, seen = there.nearest(points), there.farthest(points), there.directions(points)
    assert len(there.cells) > 100
    boxes = np.stack([points, points], axis=1)
    monkeypatch.setattr("vegtool.needs.viewers.PAIRS", 1000)
    assert there.nearest_to_boxes(boxes) == pytest.approx(near)
    for i in range(len(points)):
        one = points[i : i + 1]
        assert there.nearest(one)[0] == near[i] and there.farthest(one)[0] == far[i]
        assert there.directions(one).high[0] == seen.high[i]


def test_the_ground_in_rectangles() -> None:
    """Samples are never beyond the bounds, which those of small rectangles meet."""
    floor, random = Floor(hills()), generator(0, "ground")
    low = random.uniform(-45, 35, (60, 2))
    high = low + random.uniform(0, 20, (60, 1)) ** 2 / 20
    least, greatest = floor.within(low, high)
    share = np.stack(np.meshgrid(*[np.linspace(0, 1, 30)] * 2), axis=-1).reshape(-1, 2)
    for i in range(len(low)):
        found = floor.terrain.height(low[i] + share * (high[i] - low[i]))
        assert least[i] <= found.min() + 1e-9 and found.max() - 1e-9 <= greatest[i]
        if (high[i] - low[i]).max() < 4:  # three cells of 2 m hold it wherever it is
            assert found.min() == pytest.approx(least[i], abs=0.05)
            assert found.max() == pytest.approx(greatest[i], abs=0.05)
