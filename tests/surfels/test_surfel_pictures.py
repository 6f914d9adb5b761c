"""Pictures of surfel billboards: what is seen, how far away it is, and from which side."""

from __future__ import annotations

from dataclasses import replace
from math import atan, degrees

import numpy as np
import pytest
from surfel_cases import COARSE, ball, both, hills

from vegtool.gl.context import check, framebuffer_kept
from vegtool.gl.draw import Shot, draw
from vegtool.gl.surface import surface
from vegtool.gl.surfel_buffers import SurfelBuffers
from vegtool.gl.surfel_choice import SurfelFrame, frame_of, instances
from vegtool.gl.surfel_data import ALIKE, DIFFERENT, SurfelData
from vegtool.gl.surfel_draw import Parts, draw_surfels, picture_of_surfels
from vegtool.gl.surfel_read import surfels_seen
from vegtool.gl.surfel_scene import SurfelScene
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.measure.metrics import reference, score
from vegtool.plant import Plant
from vegtool.preview.eye import Eye, towards
from vegtool.surfels.drawn import drawn_data
from vegtool.surfels.make import surfel_model
from vegtool.surfels.model import SurfelModel

pytestmark = pytest.mark.gl
ABOVE = Light(np.array([0.0, 1.0, 0.0]))
"""A sun in the zenith: turning about y changes nothing."""
FLIP = 0.012
"""Of a statue 150 pixels high: twice as much is seen where normals are in a wrong frame."""


@pytest.fixture(scope="module")
def statue() -> tuple[SurfelModel, SurfelData]:
    model = surfel_model(sample("statue", 4000))
    return model, drawn_data(model)


def looking(plant: Plant, pixels: float, pc: float, way: np.ndarray) -> tuple[Eye, Shot]:
    """An eye from which a plant's largest side covers so many pixels, and a picture around it."""
    side = max(int(1.4 * pixels) // 2 * 2, 4)
    away = float(np.ptp(plant.bounds, axis=0).max()) * pc / pixels
    at = plant.bounds.mean(axis=0) + away * way / np.linalg.norm(way)
    yaw, pitch = towards(-way)
    eye = Eye(at, yaw, pitch, degrees(2 * atan(side / 2 / pc)), away / 100, 10 * away)
    return eye, eye.shot(side, side)


def aimed(shot: Shot, plant: Plant) -> Shot:
    """The same picture, told of from the plant's center, as pictures of plants are."""
    move = np.eye(4)
    move[:3, 3] = plant.center - shot.target
    return Shot(shot.view_projection @ move, plant.center, shot.width, shot.height)


def frame(data: SurfelData, eye: np.ndarray, pc: float) -> SurfelFrame:
    rows = instances(data, eye, np.zeros((1, 3)), np.zeros(1), np.ones(1))
    return frame_of(data, rows, pc)


def test_a_statue_looks_like_itself(statue: tuple[SurfelModel, SurfelData]) -> None:
    """From three sides, most of it billboards, some of it triangles; and as a part of either."""
    model, data = statue
    pc = model.display.pixels_per_metre(1.0)
    with PlantBuffers(model.plant) as truth, SurfelBuffers(data) as surfels:
        for way in ([1.0, 0.3, 0.5], [-1.0, 0.1, 0.7], [0.2, -0.4, -1.0]):
            eye, shot = looking(model.plant, 150, pc, np.array(way))
            what = frame(data, eye.position, pc)
            drawn = picture_of_surfels(surfels, what, shot, Light(), 2)
            found = score(reference(draw(truth, aimed(shot, model.plant), Light(), 2)), drawn)
            assert found["flip"] < FLIP
            assert abs(found["coverage_bias"]) < 0.04 and found["false_holes"] < 0.01
            parts = [
                picture_of_surfels(surfels, what, shot, Light(), parts=part)[..., 3].mean()
                for part in (Parts(True, False), Parts(False, True), Parts(False, False))
            ]
            assert parts[0] > parts[1] > 0 == parts[2]


def test_turned_scaled_and_moved_it_looks_the_same(
    statue: tuple[SurfelModel, SurfelData],
) -> None:
    model, data = statue
    pc = model.display.pixels_per_metre(1.0)
    eye, shot = looking(model.plant, 120, pc, np.array([1.0, 0.3, 0.5]))
    turn, scale, foot = 0.9, 3.0, np.array([100.0, -20.0, 40.0])
    c, s = np.cos(turn), np.sin(turn)
    around = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    there = Eye(
        foot + scale * around @ eye.position, eye.yaw_deg + np.degrees(turn), eye.pitch_deg,
        eye.fov_y_deg, scale * eye.near_m, scale * eye.far_m,
    )  # fmt: skip
    rows = instances(data, there.position, foot[None], np.array([turn]), np.array([scale]))
    with SurfelBuffers(data) as surfels:
        one = picture_of_surfels(surfels, frame(data, eye.position, pc), shot, ABOVE)
        other = picture_of_surfels(
            surfels, frame_of(data, rows, pc), there.shot(shot.width, shot.height), ABOVE
        )
    assert (np.abs(one - other).max(axis=2) > 0.02).mean() < 2e-3, "some edges round otherwise"


def test_what_is_drawn_is_as_far_as_the_surface() -> None:
    """A bumpy ball: planes of its billboards are off by a part of their depth, what is drawn of
    them by little; and each pixel's place on the plane is on the way from the eye to it."""
    model = surfel_model(ball(4), display=COARSE)
    data, plant, pc = drawn_data(model), model.plant, COARSE.pixels_per_metre(1.0)
    eye, shot = looking(plant, 8, pc, np.array([0.3, 0.2, 1.0]))
    shot = eye.shot(300, 300)
    with PlantBuffers(plant) as truth, SurfelBuffers(data) as surfels:
        seen = surfels_seen(surfels, frame(data, eye.position, pc), shot)
        on = surface(truth, aimed(shot, plant))
    x, y = on.at.T
    both = seen.billboard[y, x] >= 0
    assert both.sum() > 0.8 * len(both) and not (seen.arc[y, x] >= 0)[both].any()
    place, x, y = on.position[both], x[both], y[both]
    depth = np.linalg.norm(place - eye.position, axis=1)
    planes = np.linalg.norm(seen.plane[y, x] + plant.center - eye.position, axis=1)
    surfaces = np.linalg.norm(seen.surface[y, x] + plant.center - eye.position, axis=1)
    assert np.median(np.abs(surfaces - depth)) < 0.5 * np.median(np.abs(planes - depth))
    clip = np.concatenate(
        [seen.plane[y, x] + plant.center - eye.position, np.ones((len(x), 1))], axis=1
    )
    clip = clip @ shot.view_projection.T
    at = clip[:, :2] / clip[:, 3:]
    np.testing.assert_allclose(at[:, 0], (2 * x + 1) / 300 - 1, atol=1e-4)
    np.testing.assert_allclose(at[:, 1], 1 - (2 * y + 1) / 300, atol=1e-4)


def test_balls_cut_each_other_where_their_surfaces_do() -> None:
    """Two of radius 1 whose centers are 1 apart: whatever planes they are drawn on, the one to the
    left is seen in the left half of the picture, the other in the right."""
    model = surfel_model(ball(4, 0.0), display=COARSE)
    data, plant, pc = drawn_data(model), model.plant, COARSE.pixels_per_metre(1.0)
    eye, _ = looking(plant, 8, pc, np.array([0.0, 0.0, 1.0]))
    shot, foot = eye.shot(400, 400), np.array([[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]])
    rows = instances(data, eye.position, foot, np.zeros(2), np.ones(2))
    with SurfelBuffers(data) as surfels:
        seen = surfels_seen(surfels, frame_of(data, rows, pc), shot)
    y, x = np.nonzero(seen.billboard >= 0)
    ray = np.stack([(2 * x + 1) / 400 - 1, np.zeros(len(x))], axis=1)
    away = []
    for at in foot:
        clip = np.concatenate(
            [seen.plane[y, x] + plant.center + at - eye.position, np.ones((len(x), 1))], axis=1
        ) @ shot.view_projection.T  # fmt: skip
        away.append(np.abs(clip[:, 0] / clip[:, 3] - ray[:, 0]))
    left = away[0] < away[1]
    inner = np.abs(x + 0.5 - 200) > 5  # of some 150 pixels of radius
    assert inner.sum() > 10_000 and left[inner].mean() == pytest.approx(0.5, abs=0.03)
    assert (left == (x < 200))[inner].mean() > 0.98


@pytest.mark.parametrize(("height", "back"), [(0.0, ALIKE), (0.02, DIFFERENT)])
def test_the_wrong_side_is_dropped(height: float, back: float) -> None:
    """Hills have no underside, unless their materials say so; then they are lit from there, whether
    one picture serves both sides or not."""
    plant = hills(20, height)
    sides = replace(
        plant, materials=tuple(replace(one, double_sided=True) for one in plant.materials)
    )
    for ground, seen in ((plant, False), (sides, True)):
        model = surfel_model(ground, display=COARSE)
        data, pc = drawn_data(model), COARSE.pixels_per_metre(1.0)
        assert (data.quads[:, 3] == back).all() if seen else not data.quads[:, 3].any()
        with SurfelBuffers(data) as surfels, PlantBuffers(ground) as truth:
            for up, drawn in ((1.0, True), (-1.0, seen)):
                eye, _ = looking(ground, 6, pc, np.array([0.1, up, 0.1]))
                shot = eye.shot(100, 100)
                one = picture_of_surfels(surfels, frame(data, eye.position, pc), shot, Light())
                whole = draw(truth, aimed(shot, ground), Light())
                assert bool(one.any()) == bool(whole.any()) == drawn
                if drawn:
                    shown = (one[..., 3] > 0) & (whole[..., 3] > 0)
                    assert np.abs(one - whole)[shown].mean() < 0.03, "lit from the same side"
                    assert one[..., 3].sum() == pytest.approx(whole[..., 3].sum(), rel=0.1)


@pytest.mark.parametrize("seen", [False, True])
def test_triangles_are_dropped_from_behind_too(seen: bool) -> None:
    """From so near that there are no billboards."""
    ground = hills(20, 0.0)
    materials = tuple(replace(one, double_sided=seen) for one in ground.materials)
    ground = replace(ground, materials=materials)
    model = surfel_model(ground, display=COARSE)
    data, pc = drawn_data(model), COARSE.pixels_per_metre(1.0)
    with SurfelBuffers(data) as surfels:
        for up, drawn in ((1.0, True), (-1.0, seen)):
            eye, shot = looking(ground, 60, pc, np.array([0.1, up, 0.1]))
            what = frame(data, eye.position, pc)
            assert not surfels_seen(surfels, what, shot).billboard.max() >= 0
            picture = picture_of_surfels(surfels, what, shot, Light())
            assert bool(picture.any()) == drawn


def test_painted_and_counted(statue: tuple[SurfelModel, SurfelData]) -> None:
    """In colours of their levels; where nothing is wanted, nothing is sent."""
    model, data = statue
    pc = model.display.pixels_per_metre(1.0)
    eye, shot = looking(model.plant, 100, pc, np.array([1.0, 0.3, 0.5]))
    what = frame(data, eye.position, pc)
    palette = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1]])
    with SurfelScene() as scene:
        scene.add(data)
        assert scene.texture_bytes > data.atlas_bytes > 0
        whole = scene.picture([what], shot, Light())
        assert np.array_equal(whole, scene.picture([what], shot, Light()))
        target = scene.ctx.simple_framebuffer((shot.width, shot.height), 4, dtype="f4")
        seen = []
        with framebuffer_kept(scene.ctx):
            for view, palettes in (("painted", [palette]), ("overdraw", None), ("lit", None)):
                target.use()
                target.clear()
                drawn = scene.draw([what], shot, Light(), view, samples=0, palettes=palettes)
                pixels = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
                seen.append(pixels.reshape(-1, 4)[:, :3])
        target.release()
        check(scene.ctx)
    painted = seen[0][seen[0].any(axis=1)]
    assert ((painted > 0).sum(axis=1) == 1).all() and (painted > 0).any(axis=0).all()
    assert (seen[1] * 32 == np.rint(seen[1] * 32)).all()
    assert drawn.draws == len(what.billboards) + sum(map(len, what.patches))
    with SurfelBuffers(data) as surfels:
        nothing = replace(
            what, rows=what.rows[:0], billboards=(), patches=((),) * len(what.patches)
        )
        assert draw_surfels(surfels, nothing, shot, Light()) == (0, 0)


def test_from_behind_a_picture_of_its_own() -> None:
    """Two sheets back to back, red above and blue below, as one billboard."""
    up = hills(8, 0.0)
    down = replace(
        up, positions=up.positions - [0, 0.01, 0], faces=up.faces[:, ::-1], normals=-up.normals,
        face_material=up.face_material + 1,
    )  # fmt: skip
    colors = np.array([[1.0, 0, 0, 1], [0, 0, 1, 1]])
    sheets = both(up, down)
    sheets = replace(
        sheets, normals=np.concatenate([up.normals, down.normals]),
        materials=tuple(
            replace(one, base_color=color)
            for one, color in zip(sheets.materials, colors, strict=True)
        ),
    )  # fmt: skip
    data, pc = drawn_data(surfel_model(sheets, display=COARSE)), COARSE.pixels_per_metre(1.0)
    with SurfelBuffers(data) as surfels:
        for way, channel in ((1.0, 0), (-1.0, 2)):
            eye, _ = looking(sheets, 1, pc, np.array([0.1, way, 0.1]))
            shot = eye.shot(60, 60)
            seen = picture_of_surfels(surfels, frame(data, eye.position, pc), shot, Light())
            total = seen.sum(axis=(0, 1))
            assert total[channel] > 20 and total[:3].sum() == total[channel]
            assert surfels_seen(surfels, frame(data, eye.position, pc), shot).billboard.max() >= 0
