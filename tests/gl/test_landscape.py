"""A landscape drawn live: ground and plants, batch by batch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cards import arrays_of, cards, texture
from instanced import coverage, facing, frame_of, instance, landscape_of, seen_from

from vegtool.elements import ordered
from vegtool.gl import pace, targets
from vegtool.gl.context import framebuffer_kept
from vegtool.gl.draw import begin
from vegtool.gl.instances import INSTANCE, OVERDRAW_STEP, WHOLE, View
from vegtool.gl.landscape import (
    GROUND_COLOR,
    Batch,
    Drawn,
    Frame,
    GroundMesh,
    Landscape,
    picture,
)
from vegtool.gl.targets import drawing_target
from vegtool.lighting.light import Light
from vegtool.lighting.shading import shaded
from vegtool.plant import Material
from vegtool.seeding import generator

pytestmark = pytest.mark.gl

LIGHT = Light(np.array([0.3, 0.8, 0.5]), 0.6, 0.4, 0.2)
RED, BLUE = (
    Material(name, color, role="leaf", unlit=True, double_sided=True)
    for name, color in (("red", [1.0, 0, 0, 1]), ("blue", [0, 0, 1.0, 1]))
)


def plane(
    height: float = 0.0, half: float = 50.0, origin: tuple[float, ...] = (0, 0, 0)
) -> GroundMesh:
    corners = half * np.array([[-1.0, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]])
    corners[:, 1] = height
    up = np.tile([0.0, 1, 0], (4, 1))
    return GroundMesh(np.zeros(3), corners, up, np.array([[0, 1, 2], [0, 2, 3]]))


def drawn_into(
    landscape: Landscape, frame: Frame, how: View = "lit", **more: bool
) -> tuple[Drawn, np.ndarray]:
    """What was drawn, and 40 x 40 pixels of 4 m from 30 degrees above, top row first."""
    ctx, size = landscape.ctx, (40, 40)
    with framebuffer_kept(ctx):
        target = drawing_target(ctx, size, 0)
        begin(target, size)
        drawn = landscape.draw(frame, facing(40, 4.0, 0, 30), LIGHT, how, **more)
        data = target.frame.read((0, 0, *size), components=4, dtype="f2")
    return drawn, np.frombuffer(data, np.float16).reshape(40, 40, 4)[::-1].astype(np.float64)


NOTHING = Frame(np.zeros(0, INSTANCE), ())


def test_the_ground_is_lit_as_the_reference_says() -> None:
    """A slope of 0.3: all over it one colour."""
    slope = plane()
    normal = np.array([0.0, 1.0, 0.3]) / np.hypot(1.0, 0.3)
    ground = replace(slope, normals=np.tile(normal, (4, 1)))
    with Landscape([np.zeros((8, 8), np.uint8)], ground) as landscape:
        drawn, seen = drawn_into(landscape, NOTHING)
    wanted = shaded(np.array(GROUND_COLOR), normal, LIGHT)
    np.testing.assert_allclose(seen[30, 20, :3], wanted, rtol=2e-3)
    assert drawn == Drawn(1, 2, int(seen[..., 3].sum()))


def test_the_ground_can_be_left_out() -> None:
    with Landscape([np.zeros((8, 8), np.uint8)], plane()) as landscape:
        drawn, seen = drawn_into(landscape, NOTHING, ground=False)
        assert drawn == Drawn(0, 0, 0) and not seen.any()
        found = picture(landscape, NOTHING, facing(20, 4.0), LIGHT, ground=False)
        assert not found.any()


def test_plants_stand_on_the_ground_and_hide_it() -> None:
    """A wall of 2 x 2 m about the origin, the lower half of which is below the ground."""
    wall = cards(np.zeros(3), 1.0, RED)
    with Landscape([np.zeros((8, 8), np.uint8)], plane()) as landscape:
        for plant in (wall, cards(np.zeros(3), 1.0, BLUE)):
            landscape.add(plant, ordered(plant))
        drawn, seen = drawn_into(landscape, frame_of(instance()))
        assert drawn.draws == 2 and drawn.triangles == 4
        red = seen[..., 0] > 0.9
        assert red[15, 20] and not red[25, 20], "above the ground, and below"
        assert seen[25, 20, 1] == pytest.approx(seen[38, 2, 1], rel=0.01), "which is ground"
        # whatever is drawn first, what is nearer is seen
        rows = np.concatenate([instance(), instance((0, 0, 0.5))])
        batches = Batch(0, 0, 1, WHOLE), Batch(1, 1, 1, WHOLE)
        for order in (batches, batches[::-1]):
            _, both = drawn_into(landscape, Frame(rows, order))
            assert (both[18, 20, :3] == [0, 0, both[18, 20, 2]]).all() and both[18, 20, 2] > 0.9


def test_samples_that_pass_the_depth_test_are_counted() -> None:
    """A square of 20 x 20 pixels, and one behind it that is drawn later."""
    with landscape_of(cards(np.zeros(3), 1.0, RED)) as landscape:
        ctx, size = landscape.ctx, (40, 40)
        rows = np.concatenate([instance(), instance((0, 0, -0.001))])
        with framebuffer_kept(ctx):
            begin(drawing_target(ctx, size, 4), size)
            drawn = landscape.draw(Frame(rows, (Batch(0, 0, 2, WHOLE),)), facing(40, 4.0), LIGHT)
    assert drawn == Drawn(1, 4, 4 * 400)


def test_a_picture_in_tiles_is_the_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = generator(1, "wood")
    rows = [instance(place) for place in rng.uniform(-1.5, 1.5, (30, 3))]
    shot = facing((50, 37), 4.0, 20, 30)
    with Landscape([np.zeros((8, 8), np.uint8)], plane(-1.0)) as landscape:
        card = cards(np.zeros(3), 0.3, RED, (0, 1, 1))
        landscape.add(card, ordered(card))
        for how in ({"samples": 4}, {"supersample": 2}):
            whole = picture(landscape, frame_of(*rows), shot, LIGHT, **how)
            with monkeypatch.context() as narrow:
                narrow.setattr(targets, "SIDE", 16)
                tiled = picture(landscape, frame_of(*rows), shot, LIGHT, **how)
            # a tile's matrix is another one: a sample on an edge may fall to the other side
            assert (np.abs(tiled - whole).max(axis=2) > 1e-3).mean() < 0.02


def test_a_supersampled_picture_is_the_mean_of_its_samples() -> None:
    shot = facing(20, 4.0, 20, 30)
    with landscape_of(cards(np.zeros(3), 1.0, RED), mipmaps=False) as landscape:
        fine = picture(landscape, frame_of(instance()), replace(shot, width=60, height=60), LIGHT)
        found = picture(landscape, frame_of(instance()), shot, LIGHT, supersample=3)
    np.testing.assert_allclose(found, fine.reshape(20, 3, 20, 3, 4).mean(axis=(1, 3)), atol=1e-5)
    edge = (found[..., 3] > 0) & (found[..., 3] < 1)
    np.testing.assert_allclose(found[edge][:, 0], found[edge][:, 3] * 128 / 127.5, rtol=2e-3)


def test_any_number_of_rows_is_drawn() -> None:
    """More than fit into the first buffer, then fewer, then more again: a square of 2 x 2 pixels
    in each 4 x 4."""
    with landscape_of(cards(np.zeros(3), 0.2, RED)) as landscape:
        for side in (8, 60, 3, 90):
            at = np.stack(np.meshgrid(*2 * [np.arange(side) - (side - 1) / 2]), axis=-1)
            rows = np.zeros(side * side, INSTANCE)
            rows[:] = instance()
            rows["place"][:, :2] = at.reshape(-1, 2)
            frame = Frame(rows, (Batch(0, 0, len(rows), WHOLE),))
            seen = coverage(landscape, frame, facing(4 * side, float(side)), 0)
            covered = np.isin(np.arange(4 * side) % 4, (1, 2))
            np.testing.assert_array_equal(seen, covered[:, None] & covered)


@pytest.mark.parametrize("most", [1, 6, 7, 10])
def test_calls_in_parts_draw_the_same(monkeypatch: pytest.MonkeyPatch, most: int) -> None:
    """A renderer that holds few triangles: parts of less than an instance, of some, of all."""
    rng = generator(1, "meadow")
    rows = [instance(place) for place in rng.uniform(-1.5, 1.5, (5, 3))]
    with landscape_of(cards(np.zeros(3), 0.3, RED, (0, 1, 1))) as landscape:
        drawn, whole = drawn_into(landscape, frame_of(*rows))
        monkeypatch.setattr(pace, "MOST_TRIANGLES", most)
        again, parts = drawn_into(landscape, frame_of(*rows))
    assert whole.any() and again == drawn
    np.testing.assert_array_equal(parts, whole)


def test_what_is_far_from_the_origin_is_drawn_as_near_it() -> None:
    """The ground's origin and the eye both 5,000 km away: rows are relative to the eye anyway."""
    far = np.array([5e6, 0.0, -5e6])
    shot = facing((40, 30), 4.0, 10, 30)
    found = []
    for away in (np.zeros(3), far):
        ground = replace(plane(-0.5), origin=away)
        moved = replace(shot, target=shot.target + away)
        with Landscape([np.zeros((8, 8), np.uint8)], ground) as landscape:
            card = cards(np.zeros(3), 1.0, RED)
            landscape.add(card, ordered(card))
            found.append(picture(landscape, frame_of(instance()), moved, LIGHT, samples=4))
    np.testing.assert_array_equal(*found)


def test_a_shot_may_be_relative_to_any_point() -> None:
    """To which rows are relative too."""
    shot = facing((40, 30), 4.0, 10, 30)
    eye = np.array([1.0, 2.0, 7.0])
    with landscape_of(cards(np.zeros(3), 1.0, RED), mipmaps=False) as landscape:
        here = picture(landscape, frame_of(instance()), shot, LIGHT, supersample=4)
        there = picture(landscape, frame_of(instance(-eye)), seen_from(shot, eye), LIGHT, 4)
    assert np.abs(here - there).mean() < 1e-4


@pytest.mark.parametrize("how", ["lit", "painted", "overdraw"])
def test_every_view_leaves_the_context_as_it_was(how: View) -> None:
    """Whatever was drawn before, a picture is the same."""
    with Landscape([np.zeros((8, 8), np.uint8)], plane()) as landscape:
        one_sided = replace(RED, double_sided=False)
        for card in (cards(np.zeros(3), 1.0, RED), cards(np.zeros(3), 1.0, one_sided)):
            landscape.add(card, ordered(card))
        rows = instance((0, 0, 0.2))
        frame = Frame(rows, (Batch(0, 0, 1, WHOLE),))
        _, before = drawn_into(landscape, frame)
        drawn_into(landscape, Frame(rows, (Batch(1, 0, 1, WHOLE),)), how, wireframe=True)
        _, after = drawn_into(landscape, frame)
        np.testing.assert_array_equal(before, after)


def test_the_ground_is_a_layer_of_overdraw() -> None:
    with Landscape([np.zeros((8, 8), np.uint8)], plane()) as landscape:
        _, seen = drawn_into(landscape, NOTHING, "overdraw")
    np.testing.assert_allclose(seen[30, 20, :3], OVERDRAW_STEP)


def test_ground_from_below_does_not_depend_on_what_was_drawn_last() -> None:
    shot = facing(20, 4.0, 0, -30)
    seen = []
    for both_sides in (True, False):
        card = cards(np.zeros(3), 0.1, replace(RED, double_sided=both_sides))
        with Landscape([np.zeros((8, 8), np.uint8)], plane()) as landscape:
            landscape.add(card, ordered(card))
            seen.append(picture(landscape, frame_of(instance()), shot, LIGHT)[2, 2, 3])
    assert seen == [1, 1]


def test_inputs_stay_and_releasing_frees() -> None:
    image = texture(generator(2, "image").integers(0, 256, (16, 16, 4)))
    card = cards(np.zeros(3), 1.0, replace(RED, color_texture=image))
    ground, frame = plane(), frame_of(instance())
    before = arrays_of(card), ground.positions.copy(), frame.rows.copy()
    with Landscape([np.zeros((8, 8), np.uint8)], ground) as landscape:
        assert [landscape.add(card, ordered(card)) for _ in range(2)] == [0, 1]
        first = picture(landscape, frame, facing(20, 4.0), LIGHT, samples=4)
        second = picture(landscape, frame, facing(20, 4.0), LIGHT, samples=4)
        assert landscape.texture_bytes == sum(p.buffers.texture_bytes for p in landscape.plants)
        assert landscape.texture_bytes > 2 * 16 * 16 * 4
    assert first.tobytes() == second.tobytes()
    assert arrays_of(card) == before[0]
    np.testing.assert_array_equal(ground.positions, before[1])
    np.testing.assert_array_equal(frame.rows, before[2])
    assert landscape.texture_bytes == 0 and landscape.ctx.error == "GL_NO_ERROR"
    landscape.release()


def test_what_is_removed_is_gone_and_others_stay() -> None:
    """One of two cards is drawn as before, by its own index, which a third does not take."""
    near, far = cards(np.zeros(3), 1.0, RED), cards(np.zeros(3), 0.5, RED)
    with Landscape([np.zeros((8, 8), np.uint8)]) as landscape:
        indices = [landscape.add(card, ordered(card)) for card in (near, far)]
        frame = Frame(instance(), (Batch(indices[1], 0, 1, WHOLE),))
        before = picture(landscape, frame, facing(20, 4.0), LIGHT, samples=4)
        kept = landscape.plants[1]
        landscape.remove(indices[0])
        assert landscape.plants == [kept]
        after = picture(landscape, frame, facing(20, 4.0), LIGHT, samples=4)
        assert before.tobytes() == after.tobytes() and before[..., 3].any()
        assert landscape.add(near, ordered(near)) not in indices
        assert landscape.ctx.error == "GL_NO_ERROR"
