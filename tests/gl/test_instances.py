"""Plants drawn many times at once, against each drawn by itself, moved by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cards import arrays_of, cards, texture, together, turned
from instanced import (
    AMBIENT,
    coverage,
    facing,
    frame_of,
    instance,
    landscape_of,
    shifted,
)
from plants import plant_of

from vegtool.elements import ordered
from vegtool.gl import upload
from vegtool.gl.context import framebuffer_kept
from vegtool.gl.draw import begin, draw
from vegtool.gl.instances import (
    GROWING,
    INSTANCE,
    OVERDRAW_STEP,
    WHOLE,
    instance_program,
    vertex_rows,
    without_texels,
)
from vegtool.gl.landscape import Batch, Drawn, Frame, Landscape, picture
from vegtool.gl.targets import drawing_target
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.leaves import translucent
from vegtool.lighting.light import Light
from vegtool.plant import Material, Plant
from vegtool.seeding import generator

pytestmark = pytest.mark.gl

LIGHT = Light(np.array([0.4, 0.7, 1.0]), 0.6, 0.4, 0.2)
STEP = 1 / 255


def leaf_picture(size: int = 32) -> np.ndarray:
    """A disc in colours that change across it, clear around."""
    y, x = (np.mgrid[:size, :size] + 0.5) / size
    alpha = np.clip(8 * (0.42 - np.hypot(x - 0.5, y - 0.5)) + 0.5, 0, 1)
    return np.rint(255 * np.stack([0.3 + 0.6 * x, 0.8 - 0.5 * y, 0.2 + 0 * x, alpha], axis=-1))


def bumps(size: int = 32) -> np.ndarray:
    """A normal texture of waves."""
    y, x = (np.mgrid[:size, :size] + 0.5) / size
    slope = np.stack([0.5 * np.sin(6 * x), 0.6 * np.cos(7 * y), 1 + 0 * x], axis=-1)
    normal = slope / np.linalg.norm(slope, axis=-1, keepdims=True)
    return np.concatenate([127.5 + 127.5 * normal, np.full((size, size, 1), 255)], axis=-1)


def foliage(material: Material, count: int = 25) -> Plant:
    rng = generator(1, "foliage")
    middles = rng.uniform(-0.8, 0.8, (count, 3))
    middles[:, 1] += 1
    return cards(middles, rng.uniform(0.15, 0.35, count), material, rng.normal(size=(count, 3)))


def plants() -> dict[str, Plant]:
    """By what of a surface they show."""
    rng = generator(2, "values")
    disc, waves = texture(leaf_picture()), texture(bumps(), "normals")
    baked = texture(rng.integers(0, 256, (16, 16, 4)), "light")
    green = Material("green", [0.3, 0.7, 0.2, 1], double_sided=True, role="leaf")
    opaque = replace(green, color_texture=disc)
    masked = replace(opaque, alpha_mode="mask")
    plain = foliage(green)
    count = len(plain.positions)
    colors = np.concatenate([rng.random((count, 3)), np.ones((count, 1))], axis=1)
    exposure = rng.random((count, 2))
    passing = replace(green, transmission=0.6, transmission_tint=[1.0, 0.8, 0.3])
    return {
        "opaque": plain,
        "culled": foliage(replace(green, double_sided=False)),
        "textured": foliage(opaque),
        "masked": foliage(masked),
        "normals": foliage(replace(masked, normal_texture=waves, normal_scale=0.8)),
        "normals alone": foliage(replace(green, normal_texture=waves)),
        "exposure": replace(plain, exposure=exposure),
        "exposed leaves": replace(foliage(masked), exposure=exposure),
        "translucent": foliage(passing),
        "translucent leaves": foliage(replace(masked, transmission=0.6)),
        "light": replace(foliage(replace(passing, light_texture=baked)), exposure=exposure),
        "unlit": foliage(replace(masked, unlit=True)),
        "unlit plain": foliage(replace(green, unlit=True)),
        "colours": replace(plain, colors=colors),
        "coloured leaves": replace(foliage(masked), colors=colors),
        "two materials": together(foliage(masked, 12), foliage(replace(green, role="wood"), 9)),
        "a tree": without_normals(sample("broadleaf", 1200)),
        "a lit bush": translucent(without_normals(sample("bush", 900)), 0.5),
    }


def without_normals(plant: Plant) -> Plant:
    """Whose tubes have a normal texture, of which frames at vertices make something else."""
    return replace(plant, materials=tuple(replace(m, normal_texture=None) for m in plant.materials))


WHERE = {"yaw": 0.7, "scale": 1.3}
FOOT = np.array([0.2, -1.2, 0.1])


def by_hand(plant: Plant, *moved: Plant, size_m: float = 3.5, supersample: int = 3) -> np.ndarray:
    """What gl.draw draws of plants that were moved; tints of 128 are 128 / 127.5."""
    shot = facing((70, 60), size_m, 25, 12)
    buffers = [PlantBuffers(one) for one in (plant, *moved)]
    try:
        found = draw(buffers, shot, LIGHT, supersample=supersample)
    finally:
        for one in buffers:
            one.release()
    return found * (128 / 127.5, 128 / 127.5, 128 / 127.5, 1)


def assert_same(found: np.ndarray, wanted: np.ndarray, rest: float = 0.005) -> None:
    """To a grey level but for a few pixels, on edges, of whose nine samples one falls to the other
    side."""
    assert (wanted[..., 3] > 0).mean() > 0.05, "there is something to see"
    off = np.abs(found - wanted).max(axis=-1)
    assert (off > STEP).mean() <= rest, f"{(off > STEP).mean():.4f} differ, up to {off.max():.3f}"
    assert np.abs(found - wanted).mean() < STEP / 4


@pytest.mark.parametrize("name", list(plants()))
def test_an_instance_is_the_plant_turned_scaled_and_moved(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(upload, "MINIFIED", np.inf)  # all textures are filtered
    plant = plants()[name]
    scale = WHERE["scale"] * 2 / plant.extent
    foot = FOOT - (0, plant.bounds[0, 1] * scale, 0) if "a " in name else FOOT
    row = instance(foot, yaw=WHERE["yaw"], scale=scale)
    with landscape_of(plant, mipmaps=False) as landscape:
        shot = facing((70, 60), 3.5, 25, 12)
        found = picture(landscape, frame_of(row), shot, LIGHT, supersample=3)
    assert_same(found, by_hand(turned(plant, WHERE["yaw"], scale, foot)))


def test_frames_at_vertices_are_nearly_those_of_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    """On tubes, along which they turn: to four grey levels, and none on average."""
    monkeypatch.setattr(upload, "MINIFIED", np.inf)
    plant = sample("dead-tree", 900)
    assert any(material.normal_texture is not None for material in plant.materials)
    scale = 2.4 / plant.extent
    with landscape_of(plant, mipmaps=False) as landscape:
        shot = facing((70, 60), 3.5, 25, 12)
        row = instance(FOOT, yaw=WHERE["yaw"], scale=scale)
        found = picture(landscape, frame_of(row), shot, LIGHT, supersample=3)
    wanted = by_hand(turned(plant, WHERE["yaw"], scale, FOOT))
    off = np.abs(found - wanted)[wanted[..., 3] > 0]
    assert (off.max(axis=-1) > 4 * STEP).mean() < 0.05 and off.mean() < STEP


def test_two_instances_are_two_plants() -> None:
    plant = plants()["masked"]
    rows = instance((-0.6, -1, 0), yaw=2.0), instance((0.7, -1.1, -1), yaw=-1.0, scale=0.8)
    with landscape_of(plant, mipmaps=False) as landscape:
        shot = facing((70, 60), 3.5, 25, 12)
        found = picture(landscape, frame_of(*rows), shot, LIGHT, supersample=3)
        again = picture(landscape, frame_of(*rows[::-1]), shot, LIGHT, supersample=3)
    moved = turned(plant, 2.0, 1, (-0.6, -1, 0)), turned(plant, -1.0, 0.8, (0.7, -1.1, -1))
    assert_same(found, by_hand(*moved))
    np.testing.assert_array_equal(found, again)


def test_several_plants_and_batches_draw_their_own_rows() -> None:
    """Three rows in two batches, of which the second begins in the middle of the buffer."""
    one, other = plants()["opaque"], plants()["unlit"]
    rows = np.concatenate(
        [instance((-1, -1, 0), yaw=1.0), instance((0, -1, 0.3)), instance((1, -1, 0), yaw=3.0)]
    )
    frame = Frame(rows, (Batch(1, 2, 1, WHOLE), Batch(0, 0, 2, WHOLE)))
    with landscape_of(one, other, mipmaps=False) as landscape:
        found = picture(landscape, frame, facing((70, 60), 3.5, 25, 12), LIGHT, supersample=3)
    first = turned(one, 1.0, 1, (-1, -1, 0)), turned(one, 0, 1, (0, -1, 0.3))
    assert_same(found, by_hand(*first, turned(other, 3.0, 1, (1, -1, 0))))


def test_a_tint_is_a_factor_of_the_colour() -> None:
    tint = (255, 64, 0)
    factor = np.array(tint) / 127.5
    shot = facing(40, 2.5)
    for name in ("opaque", "masked", "unlit"):
        with landscape_of(plants()[name], mipmaps=False) as landscape:
            plain = picture(landscape, frame_of(instance((0, -1, 0))), shot, LIGHT)
            found = picture(landscape, frame_of(instance((0, -1, 0), tint=tint)), shot, LIGHT)
        np.testing.assert_allclose(
            found[..., :3], plain[..., :3] / (128 / 127.5) * factor, rtol=2e-3, atol=1e-3
        )
        np.testing.assert_array_equal(found[..., 3], plain[..., 3])


def test_the_width_is_a_factor_across_the_trunk() -> None:
    """Not along it: a picture half as wide, drawn twice as wide, is the same."""
    plant = plants()["unlit"]
    narrow = replace(plant, positions=plant.positions * (0.5, 1, 0.5))
    shot = facing((70, 60), 3.5, 25, 12)
    with landscape_of(plant, mipmaps=False) as landscape:
        found = picture(landscape, frame_of(instance(FOOT, width=0.5, yaw=0.4)), shot, LIGHT, 3)
    assert_same(found, by_hand(turned(narrow, 0.4, 1.0, FOOT)))


# -- elements --------------------------------------------------------------------------------------


def rows_of_cards(count: int = 40) -> Plant:
    """Cards that do not overlap, each of its own height."""
    at = np.stack(np.meshgrid(np.arange(8) - 3.5, np.arange(5) - 2.0), axis=-1).reshape(-1, 2)
    middles = np.concatenate([0.4 * at[:count], np.zeros((count, 1))], axis=1)
    return cards(middles, 0.1, Material("leaf", role="leaf"))


def kept_by_hand(plant: Plant, kept: float, length: float = 1.0) -> Plant:
    """What is left of a plant: an element's size goes from 0 to 1 as its rank goes from the share
    that is kept to GROWING of that share below it."""
    found = ordered(plant)
    positions = np.empty((len(found.vertex), 3))
    for vertex, of in enumerate(found.vertex):
        size = min(max((kept - found.rank[vertex]) / (GROWING * kept), 0.0), 1.0)
        size *= length if found.grows[vertex] else 1.0
        middle = found.middle[vertex]
        positions[vertex] = middle + size * (plant.positions[of] - middle)
    return Plant(
        plant.name, positions, plant.normals[found.vertex], plant.uvs[found.vertex], found.faces,
        found.face_material, plant.materials,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("kept", "length"), [(WHOLE, 1.0), (1.0, 1.0), (0.5, 1.2), (0.21, 1.5), (0.02, 1.0)]
)
def test_what_is_kept_is_the_first_part_and_its_last_grow(kept: float, length: float) -> None:
    stems = replace(plant_of(0.3 * generator(3, "stems").normal(size=(20, 3, 3))),
                    materials=(Material("wood", double_sided=True),))  # fmt: skip
    plant = together(rows_of_cards(), stems)
    with landscape_of(plant, mipmaps=False) as landscape:
        shot = facing((70, 60), 3.5, 25, 12)
        row = instance(kept=kept, length=length)
        found = picture(landscape, frame_of(row), shot, LIGHT, supersample=3)
    left = kept_by_hand(plant, kept, length)
    wanted = by_hand(left)
    off = np.abs(found - wanted).max(axis=-1)
    assert (off > STEP).mean() <= 0.005
    assert found[..., 3].any()


def test_nothing_pops() -> None:
    """Coverage grows with the share that is kept; from a third of it on several elements grow at a
    time, so that it does in steps of hardly more than what the share does."""
    plant, shares = rows_of_cards(), np.linspace(0, WHOLE, 121)
    with landscape_of(plant, mipmaps=False) as landscape:
        covered = np.array(
            [
                coverage(landscape, frame_of(instance(kept=kept)), facing(100, 3.5), 0, 2).sum()
                for kept in shares
            ]
        )
    assert covered[0] == 0 and (np.diff(covered) >= 0).all()
    assert covered[-1] == pytest.approx(40 * (0.2 * 100 / 3.5) ** 2, rel=0.03)
    steps = np.diff(covered) / covered[-1]
    assert steps[shares[:-1] > 1 / 3].max() < 1.6 * (shares[1] - shares[0])


def drawn_triangles(landscape: Landscape, frame: Frame) -> tuple[Drawn, int]:
    """What the landscape says it drew, and what OpenGL counts."""
    ctx, size = landscape.ctx, (40, 40)
    query = ctx.query(primitives=True)
    with framebuffer_kept(ctx):
        begin(drawing_target(ctx, size, 0), size)
        with query:
            drawn = landscape.draw(frame, facing(40, 4.0), AMBIENT)
    return drawn, query.primitives


@pytest.mark.parametrize("share", [0.0, 0.001, 0.25, 0.5, 0.7501, 1.0, WHOLE])
def test_faces_kept_are_those_below_the_share(share: float) -> None:
    """Counted one by one, and by OpenGL."""
    plant = sample("bush", 900)
    found = ordered(plant)
    plain = sum(rank < share for rank in found.face_rank.tolist())
    with landscape_of(plant) as landscape:
        (made,) = landscape.plants
        assert made.faces_kept(share) == plain
        rows = instance(kept=share), instance((1, 0, 0), kept=share / 3)
        frame = Frame(np.concatenate(rows), (Batch(0, 0, 2, share),))
        drawn, counted = drawn_triangles(landscape, frame)
        assert drawn.triangles == counted == 2 * plain
        materials = {*found.face_material[found.face_rank < share].tolist()}
        assert drawn.draws == len(materials)
    assert plain == len(plant.faces) or share < 1


def test_nothing_is_drawn_of_no_rows() -> None:
    with landscape_of(plants()["opaque"]) as landscape:
        empty = Frame(np.zeros(0, INSTANCE), ())
        drawn, counted = drawn_triangles(landscape, empty)
        assert (drawn, counted) == (Drawn(0, 0, 0), 0)
        none = Frame(instance(), (Batch(0, 0, 0, WHOLE),))
        assert drawn_triangles(landscape, none)[1] == 0


# -- alpha -----------------------------------------------------------------------------------------


PIXELS = 40
"""Across a card of 1 m."""
RADIUS = 0.4


def disc(texels: int, width: float) -> Plant:
    """A card of 1 m, on which a disc is left of an alpha that falls along a width in metres."""
    y, x = (np.mgrid[:texels, :texels] + 0.5) / texels - 0.5
    image = np.full((texels, texels, 4), 255.0)
    image[..., 3] = np.rint(255 * np.clip(0.5 + (RADIUS - np.hypot(x, y)) / width, 0, 1))
    leaf = Material("leaf", color_texture=texture(image), alpha_mode="mask", role="leaf")
    return cards(np.zeros(3), 0.5, leaf)


@pytest.mark.parametrize(
    ("texels", "width"), [(32, 0.25), (64, 0.06), (128, 0.06), (128, 0.02), (256, 0.02)]
)
def test_edges_are_tested_at_each_sample_and_leaves_keep_their_area(
    texels: int, width: float
) -> None:
    """Of texels smaller and larger than pixels. Over places in the grid of pixels the area of the
    disc is what it is to five per mille, and edges are off from what 256 samples make of them by
    less than half of what one test for all four is."""
    plant = disc(texels, width)
    shots = [
        shifted(facing(64, 64 / PIXELS), *place) for place in generator(4, "places").random((12, 2))
    ]
    whole = frame_of(instance())
    with landscape_of(plant) as landscape, PlantBuffers(plant, mipmaps=True) as buffers:
        soft = np.stack([coverage(landscape, whole, shot) for shot in shots])
        hard = np.stack([draw(buffers, shot, AMBIENT, samples=4)[..., 3] for shot in shots])
    with landscape_of(plant, mipmaps=False) as landscape:
        exact = np.stack([coverage(landscape, whole, shot, 0, 16) for shot in shots])
    area = len(shots) * PIXELS**2 * np.pi * RADIUS**2
    assert soft.sum() == pytest.approx(area, rel=0.005)
    edge = (exact > 0.02) & (exact < 0.98)
    off = [float(np.sqrt(np.mean((one - exact)[edge] ** 2))) for one in (soft, hard)]
    assert off[0] < 0.5 * off[1]


@pytest.mark.parametrize("kind", ["masked", "opaque"])
def test_what_is_covered_by_a_texture_in_full_has_no_holes(kind: str) -> None:
    """Mips of a texture that is white all over, seen at every size."""
    material = Material(
        "white", color_texture=texture(np.full((64, 64, 4), 255)), role="leaf",
        alpha_mode="mask" if kind == "masked" else "opaque",
    )  # fmt: skip
    with landscape_of(cards(np.zeros(3), 0.5, material)) as landscape:
        for pixels in (2, 20, 64, 100):
            seen = coverage(landscape, frame_of(instance()), facing(pixels, 0.5, 30, 40))
            assert (seen == 1).all()


def test_opaque_materials_ignore_alpha() -> None:
    """A texture that is cut out for another material too: squares of alpha 0 and 1."""
    squares = np.full((16, 16, 4), 255)
    squares[..., 3] = 255 * (np.add(*np.indices((16, 16)) // 2) % 2)
    paper = Material("paper", color_texture=texture(squares), role="leaf")
    with landscape_of(cards(np.zeros(3), 0.5, paper)) as landscape:
        for pixels in (16, 40, 64):
            seen = coverage(landscape, frame_of(instance()), facing(pixels, 0.9))
            assert (seen == 1).all()


# -- views -----------------------------------------------------------------------------------------


def viewed(landscape: Landscape, frame: Frame, how: str, **more: bool) -> np.ndarray:
    """(h, w, 3) a view of 40 x 40 pixels of 4 m, top row first."""
    ctx, size = landscape.ctx, (40, 40)
    with framebuffer_kept(ctx):
        target = drawing_target(ctx, size, 0)
        begin(target, size)
        landscape.draw(frame, facing(40, 4.0), AMBIENT, how, **more)
        data = target.frame.read((0, 0, *size), components=4, dtype="f2")
    return np.frombuffer(data, np.float16).reshape(40, 40, 4)[::-1, :, :3].astype(np.float64)


def layers(count: int, material: Material) -> Plant:
    """Squares of 2 m, one behind the other."""
    return cards(np.arange(count)[:, None] * (0, 0, -0.1), 1.0, material)


@pytest.mark.parametrize("name", ["opaque", "masked"])
def test_overdraw_adds_a_step_for_each_layer(name: str) -> None:
    leaf = Material("leaf", role="leaf")
    if name == "masked":
        picture_of = texture(np.full((8, 8, 4), 255))
        leaf = replace(leaf, color_texture=picture_of, alpha_mode="mask")
    for count in (1, 3):
        with landscape_of(layers(count, leaf)) as landscape:
            once = frame_of(instance())
            twice = frame_of(instance(), instance((0, 0, 0.05)))
            for frame, times in ((once, count), (twice, 2 * count)):
                seen = viewed(landscape, frame, "overdraw")
                np.testing.assert_allclose(seen[20, 20], times * OVERDRAW_STEP)
                assert seen[2, 2].tolist() == [0, 0, 0]
            # and the next picture has its depth test and its colours back
            np.testing.assert_allclose(
                viewed(landscape, twice, "lit")[20, 20], 128 / 127.5, rtol=1e-3
            )


def test_painted_shows_tints_alone_lit() -> None:
    """White light, so that they are what is seen; of textures there is the alpha left."""
    tint = (200, 40, 90)
    disc = Material("leaf", [0.1, 0.2, 0.3, 1], texture(leaf_picture()), alpha_mode="mask")
    for material in (disc, replace(disc, color_texture=None), replace(disc, unlit=True)):
        with landscape_of(layers(1, material)) as landscape:
            seen = viewed(landscape, frame_of(instance(tint=tint)), "painted")
            np.testing.assert_allclose(seen[20, 20], np.array(tint) / 127.5, rtol=2e-3)
            # the corner of the square, which the disc leaves clear
            corner = seen[11, 11]
            assert corner.any() == (material.color_texture is None)


def test_wireframe_draws_edges_alone() -> None:
    """Of a square of 20 x 20 pixels: its border and a diagonal, 60 to 120 pixels of 400."""
    with landscape_of(layers(1, Material("leaf", role="leaf"))) as landscape:
        whole = viewed(landscape, frame_of(instance()), "lit").any(axis=-1)
        edges = viewed(landscape, frame_of(instance()), "lit", wireframe=True).any(axis=-1)
        again = viewed(landscape, frame_of(instance()), "lit").any(axis=-1)
    assert whole.sum() == 400 and 60 <= edges.sum() <= 120
    assert edges[10:30, 9:12].any(axis=1).all() and edges[20, 14:26].sum() <= 4
    np.testing.assert_array_equal(whole, again)


# -- what is uploaded ------------------------------------------------------------------------------


def test_rows_hold_what_a_vertex_has() -> None:
    plant = plants()["normals"]
    plant = replace(plant, exposure=generator(5, "e").random((len(plant.positions), 2)))
    found = ordered(plant)
    rows, faces = vertex_rows(plant, found)
    assert rows.shape[1] == 24 and faces.shape == found.faces.shape
    for face, before in zip(faces, found.faces, strict=True):
        for vertex, element in zip(face, before, strict=True):
            of = found.vertex[element]
            row = rows[vertex].astype(np.float64)
            wanted = [
                *plant.positions[of], plant.uvs[of, 0], *plant.normals[of], plant.uvs[of, 1],
                1, 1, 1, 1, *found.middle[element], found.rank[element], *plant.exposure[of],
                found.grows[element], 0,
            ]  # fmt: skip
            np.testing.assert_allclose(row[:20], wanted, atol=1e-6)
            # a unit tangent across the normal, along which u grows: to the right of a card
            assert abs(row[20:23] @ plant.normals[of]) < 1e-6
            assert np.linalg.norm(row[20:23]) == pytest.approx(1)
            card = plant.positions[4 * (of // 4) :][:2]
            assert row[20:23] @ (card[1] - card[0]) > 0 and abs(row[23]) == 1


def test_mirrored_pictures_split_vertices() -> None:
    """Triangles that share an edge, one of whose pictures is mirrored: four vertices are six."""
    card = plants()["normals"]
    plant = replace(
        card, positions=card.positions[:4], normals=card.normals[:4],
        uvs=np.array([[0.0, 1], [1, 1], [0, 0], [1, 1]]), faces=card.faces[:2],
        face_material=[0, 0],
    )  # fmt: skip
    rows, faces = vertex_rows(plant, ordered(plant))
    assert len(rows) == 6 and len({*faces.ravel().tolist()}) == 6
    assert sorted(rows[faces[:, 0], 23]) == [-1, 1]


def test_faces_that_show_one_place_of_a_texture_are_without_texels() -> None:
    """As the mesh of a hybrid level, beside planes in the same draw call."""
    leaf = Material("leaf", color_texture=texture(leaf_picture()), alpha_mode="mask")
    planes, mesh = cards(np.eye(3), 0.1, leaf), cards(-np.eye(3), 0.1, leaf)
    mesh = replace(mesh, uvs=np.full_like(mesh.uvs, 0.25))
    both = replace(together(planes, mesh), materials=(leaf,), face_material=np.zeros(12, np.int32))
    assert without_texels(both).tolist() == [False] * 12 + [True] * 12
    assert without_texels(cards(np.eye(3))).all(), "no texture at all"


def test_what_has_no_texels_fades_by_elements() -> None:
    """Where texels fade, a mesh keeps the share of its elements in place of its texels, and a plane
    beside it all of its own."""
    leaf = Material("leaf", color_texture=texture(np.full((4, 4, 4), 255)), alpha_mode="mask")
    plane = replace(rows_of_cards(), materials=(leaf,))
    mesh = replace(plane, uvs=np.full_like(plane.uvs, 0.25))
    shot = facing(100, 3.5)
    half = frame_of(instance(solid=0.5), fading=True)
    for one, kept in ((mesh, 0.5 * WHOLE), (plane, WHOLE)):
        with landscape_of(one) as landscape:
            found = coverage(landscape, half, shot)
            wanted = coverage(landscape, frame_of(instance(kept=kept)), shot)
        np.testing.assert_array_equal(found, wanted)


def test_a_program_has_no_more_than_its_material_needs() -> None:
    """Programs of two materials that show the same are one."""
    made = plants()
    with landscape_of(made["masked"], made["unlit"], made["opaque"]) as landscape:
        names = []
        for plant in landscape.plants:
            (group,) = plant.buffers.groups
            shader = instance_program(plant.buffers, group, "", 4)
            assert shader is instance_program(plant.buffers, group, "", 4)
            fading = instance_program(plant.buffers, group, "texels", 4)
            assert ("noise" in fading) == (group.material.color_texture is not None)
            assert "noise" in instance_program(plant.buffers, group, "pixels", 4)
            names.append({*shader})
        assert "color_map" in names[0] and "sun_direction" in names[0]
        assert "color_map" in names[1] and "sun_direction" not in names[1]
        assert "color_map" not in names[2]


def test_inputs_stay_and_releasing_frees() -> None:
    plant = plants()["two materials"]
    before, found = arrays_of(plant), ordered(plant)
    kept = [found.faces.copy(), found.middle.copy()]
    row = instance(yaw=1.0)
    bytes_before = row.tobytes()
    landscape = Landscape([np.zeros((8, 8), np.uint8)])
    with landscape:
        assert landscape.add(plant, found) == 0 and landscape.add(plant, found) == 1
        first = picture(landscape, frame_of(row), facing(30, 3.5), LIGHT, samples=4)
        second = picture(landscape, frame_of(row), facing(30, 3.5), LIGHT, samples=4)
        color_map = landscape.plants[0].buffers.groups[0].color_map
    assert first.tobytes() == second.tobytes()
    assert arrays_of(plant) == before and row.tobytes() == bytes_before
    np.testing.assert_array_equal(found.faces, kept[0])
    np.testing.assert_array_equal(found.middle, kept[1])
    assert type(color_map.mglo).__name__ == "InvalidObject"
    assert landscape.plants == [] and landscape.ctx.error == "GL_NO_ERROR"
