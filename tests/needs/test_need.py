"""What is seen of species: against each plant from each eye, and by hand."""

from __future__ import annotations

from dataclasses import replace
from math import atan, atan2, hypot, inf, pi
from pathlib import Path

import numpy as np
import pytest
from needs_cases import FLAT, HEIGHT, Standing, hills, scene_with, standing, stations, tree

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.lighting.light import Sun
from vegtool.lod import Display
from vegtool.needs.arcs import STEP
from vegtool.needs.inside import inside
from vegtool.needs.need import Need, ball_of, needs_of
from vegtool.needs.viewers import viewers_of
from vegtool.scene import Scene
from vegtool.seeding import generator
from vegtool.tiles.placement import Placement
from vegtool.tiles.terrain import Terrain

ROAD = stations("position = [-50, 0]", "position = [50, 0]")
SQUARE = "polygon = [[-10, -10], [10, -10], [10, 10], [-10, 10]]\nheight_m = [1, 2]"
DRONE = "polygon = [[-50, -50], [50, -50], [50, 50], [-50, 50]]\nheight_m = [100, 120]"


def need_of(scene: Scene, placement: Placement, ground: Terrain = FLAT) -> Need:
    return needs_of(scene, [tree()], placement, ground)[0]


def wood(ground: Terrain, beside: float, count: int = 40) -> Standing:
    """Plants of all sizes from so far along x on, turned by up to a quarter."""
    random = generator(0, "wood")
    xz = random.uniform([beside, -35], [38, 35], (count, 2))
    foot = np.stack([xz[:, 0], ground.height(xz), xz[:, 1]], axis=1)
    return Standing(foot, random.uniform(0, pi / 2, count), random.uniform(2, 25, count))


def seen(plants: Standing, eyes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(n, m): distances at scale 1, azimuths in the plants' own frames, and elevations, as seen
    from their middles; each plant turned back as it is drawn, by its cosine and sine."""
    scale = plants.height[:, None] / HEIGHT
    foot = plants.foot.astype(np.float32).astype(np.float64)
    x, y, z = np.moveaxis(eyes - foot[:, None], 2, 0)
    y = y - scale * HEIGHT / 2
    c, s = np.cos(plants.yaw)[:, None], np.sin(plants.yaw)[:, None]
    own_x, own_z = c * x - s * z, c * z + s * x
    flat = np.hypot(own_x, own_z)
    return np.hypot(flat, y) / scale, np.arctan2(own_x, own_z), np.arctan2(y, flat)


CASES = {
    "a road": ("", stations("position = [-30, 30]", "position = [-8, 0]", "position = [-30, -9]")),
    "a road and its sides": ("margin_m = 3\nheight_m = [1, 3]", ROAD.replace("50, 0", "9, 0")),
    "a flight": (
        "margin_m = 2", stations("position = [-38, 118, 0]", "position = [-3, 140, 20]"),
    ),
    "a square": ("polygon = [[-38, -9], [-20, -9], [-20, 9], [-38, 9]]\nheight_m = [1, 4]", None),
    "from below": (
        "polygon = [[-38, -9], [-9, -9], [-9, 9]]\nheight_m = [1, 20]\nabove = false", None,
    ),
    "everywhere": ("height_m = [50, 60]", None),
}  # fmt: skip


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("beside", [0.0, -38.0])
def test_no_eye_sees_more(tmp_path: Path, case: str, beside: float) -> None:
    """Plants on hills, turned and scaled, among the eyes and beside them."""
    ground = hills()
    plants, scene = wood(ground, beside), scene_with(tmp_path, *CASES[case])
    viewers = viewers_of(scene, ground)
    need = need_of(scene, plants, ground)
    eyes = inside(viewers, 3000, 0).position
    away, azimuth, elevation = seen(plants, eyes)
    top = plants.foot[:, 1] + plants.height
    counts = np.ones(away.shape, np.bool_)
    if scene.camera.above is False:  # but where all eyes are above
        counts = (eyes[:, 1] <= top[:, None]) | (viewers.cells.low.min() > top)[:, None]
    assert need.plants == len(plants.foot)
    assert need.nearest <= away.min() + 1e-5 and away.max() - 1e-3 <= need.farthest
    assert need.elevation[0] - 1e-6 <= elevation[counts].min()
    assert elevation[counts].max() <= need.elevation[1] + 1e-6
    turned = (azimuth - need.azimuth[0] + 1e-6) % (2 * pi)
    assert (turned <= need.azimuth[1] + 2e-6).all()
    assert need.above >= bool((eyes[:, 1] > plants.foot[:, 1].min()).any())
    assert need.below >= bool((eyes[:, 1] < top.max()).any())
    size_px = HEIGHT * Display().pixels_per_metre(1.0)
    assert need.largest_px >= size_px / away.min() - 1e-6


def test_tiles_that_add_nothing_are_as_if_looked_at(tmp_path: Path) -> None:
    """However plants are cut into tiles, and in which order, the same comes out."""
    ground = hills()
    plants, scene = wood(ground, -38.0), scene_with(tmp_path, *CASES["a square"])
    whole = need_of(scene, replace(plants, of_tile=len(plants.foot)), ground)
    back = replace(
        plants, foot=plants.foot[::-1], yaw=plants.yaw[::-1], height=plants.height[::-1], of_tile=1
    )
    for other in (plants, back):
        found = need_of(scene, other, ground)
        assert found.plants == whole.plants and found.azimuth == whole.azimuth
        assert (found.nearest, found.farthest) == pytest.approx((whole.nearest, whole.farthest))
        assert found.elevation == pytest.approx(whole.elevation)


@pytest.mark.parametrize("case", CASES)
def test_groups_that_add_nothing_are_as_if_looked_at(
    tmp_path: Path, case: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether plants are asked one by one, or in groups down to single ones."""
    ground = hills()
    plants, scene = wood(ground, 0.0, 60), scene_with(tmp_path, *CASES[case])
    found = []
    for few in (1, 60):
        monkeypatch.setattr("vegtool.needs.need.FEW", few)
        found.append(need_of(scene, replace(plants, of_tile=60), ground))
    grouped, single = found
    assert (grouped.nearest, grouped.farthest) == pytest.approx((single.nearest, single.farthest))
    assert grouped.elevation == pytest.approx(single.elevation)
    assert grouped.azimuth == single.azimuth


def test_a_road_and_a_tree_beside_it(tmp_path: Path) -> None:
    """100 m of it along x, at 1.7 m; the tree stands 8 m to the south, and its middle is 3.3 m
    above the eyes."""
    need = need_of(scene_with(tmp_path, "", ROAD), standing([[0, 0, 8]]))
    assert need.nearest == pytest.approx(hypot(8, 3.3))
    assert need.farthest == pytest.approx(hypot(50, 8, 3.3))
    start, extent = need.azimuth
    assert start == pytest.approx(pi - atan(50 / 8), abs=STEP)  # eyes are towards -z
    assert 2 * atan(50 / 8) <= extent <= 2 * atan(50 / 8) + 2 * STEP
    assert need.elevation == pytest.approx((atan2(-3.3, 8), atan2(-3.3, hypot(50, 8))))
    assert need.above and need.below  # of its lowest twigs, and of its crown
    assert need.largest_px == pytest.approx(10 * need.display.pixels_per_metre(hypot(8, 3.3)))


def test_a_turned_tree_is_seen_from_another_side(tmp_path: Path) -> None:
    """Turned by 90 degrees about y, +z to +x: what was seen from -z is now seen from its +x."""
    plants = standing([[0, 0, 8]], yaw=[pi / 2])
    need = need_of(scene_with(tmp_path, "", ROAD), plants)
    middle = need.azimuth[0] + need.azimuth[1] / 2
    assert middle == pytest.approx(pi / 2, abs=STEP)


def test_trees_turned_at_random_are_seen_from_everywhere(tmp_path: Path) -> None:
    plants = standing([[0, 0, 8]] * 9, yaw=[i * 2 * pi / 9 for i in range(9)])
    assert need_of(scene_with(tmp_path, "", ROAD), plants).azimuth == (0.0, 2 * pi)


def test_a_square_and_a_tree_of_twice_the_size(tmp_path: Path) -> None:
    """20 m high at 30 m along x: a tree of the model's size is half as far away."""
    need = need_of(scene_with(tmp_path, SQUARE), standing([[30, 0, 0]], height=[20.0]))
    assert need.nearest == pytest.approx(hypot(20, 10 - 2) / 2)
    assert need.farthest == pytest.approx(hypot(40, 10, 10 - 1) / 2)
    assert need.azimuth[1] == pytest.approx(2 * atan(10 / 20), abs=2 * STEP)


def test_a_drone(tmp_path: Path) -> None:
    """At 100 to 120 m over 100 x 100 m: a tree in its middle is never seen from below."""
    need = need_of(scene_with(tmp_path, DRONE), standing([[0, 0, 0]]))
    assert need.nearest == pytest.approx(95) and need.farthest == pytest.approx(hypot(50, 50, 115))
    assert need.elevation == pytest.approx((atan2(95, hypot(50, 50)), pi / 2))
    assert need.above and not need.below and need.azimuth == (0.0, 2 * pi)


def test_a_scene_turned_about_y(tmp_path: Path) -> None:
    """A road and a tree, both turned: the tree is seen as before, in its own frame."""
    turn = 0.7
    c, s = np.cos(turn), np.sin(turn)

    def at(x: float, z: float) -> tuple[float, float]:
        return float(c * x + s * z), float(c * z - s * x)

    plain = need_of(scene_with(tmp_path, "", ROAD), standing([[0, 0, 8]]))
    road = stations(f"position = {list(at(-50, 0))}", f"position = {list(at(50, 0))}")
    x, z = at(0, 8)
    turned = need_of(scene_with(tmp_path, "", road), standing([[x, 0, z]], yaw=[turn]))
    assert turned.azimuth == pytest.approx(plain.azimuth, abs=2 * STEP)
    assert turned.elevation == pytest.approx(plain.elevation)
    assert (turned.nearest, turned.farthest) == pytest.approx((plain.nearest, plain.farthest))


def test_nothing_is_said(tmp_path: Path) -> None:
    """Without a camera and light, everything is needed."""
    need = need_of(Scene(tmp_path / "trees.csv"), standing([[0, 0, 0], [100, 0, 50]]))
    assert (need.nearest, need.farthest, need.largest_px) == (0, inf, inf)
    assert need.azimuth == (0, 2 * pi) and need.elevation == (-pi / 2, pi / 2)
    assert need.above and need.below and need.lit == "unsaid" and need.sun is None
    assert need.display == Display()


def test_light(tmp_path: Path) -> None:
    text = "\n[light]\nmoves = {}\nsun = [135, 40]"
    for moves, lit in (("true", "moving"), ("false", "fixed")):
        need = need_of(scene_with(tmp_path, SQUARE + text.format(moves)), standing([[0, 0, 0]]))
        assert need.lit == lit and need.sun == Sun(135, 40)


def test_a_species_that_stands_nowhere(tmp_path: Path) -> None:
    found = needs_of(scene_with(tmp_path, SQUARE), [tree(), tree()], standing([[30, 0, 0]]), FLAT)
    assert (found[0].plants, found[1].plants) == (1, 0)
    assert found[1].nearest == inf and found[1].largest_px == 0


def test_the_ball() -> None:
    """Half as high as the tree, and as wide as a corner of its bounds is far from the axis."""
    assert ball_of(tree()) == pytest.approx((5, hypot(2, 2, 5)))


@pytest.mark.parametrize(
    ("camera", "says"),
    [
        (DRONE + "\nabove = false", "line 4: above is false, and eyes are up to 120 m above the"),
        (SQUARE + "\nabove = true", "line 4: above is true, and no eye is higher than 2 m"),
    ],
)
def test_contradictions(tmp_path: Path, camera: str, says: str) -> None:
    """Trees of 10 m on a hill of 50 m are below the drone, and above the square."""
    with pytest.raises(UsageError) as caught:
        need_of(scene_with(tmp_path, camera), standing([[0, 50, 0]]))
    assert says in str(caught.value)


def test_no_contradictions(tmp_path: Path) -> None:
    """Eyes below the tops, or at heights that nobody says: seen from no higher than the top."""
    plants = standing([[30, 0, 0]])
    for camera in (SQUARE, SQUARE.split("\n")[0]):
        need = need_of(scene_with(tmp_path, camera + "\nabove = false"), plants)
        highest = atan2(5, 20) if "height" not in camera else atan2(-3, hypot(40, 10))
        assert need.elevation[1] == pytest.approx(highest)
    need_of(scene_with(tmp_path, DRONE + "\nabove = true"), plants)
