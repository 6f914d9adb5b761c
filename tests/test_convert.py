"""The pipeline: what a chain of levels promises, on small made plants."""

from __future__ import annotations

from dataclasses import fields, replace
from itertools import pairwise

import numpy as np
import pytest

from vegtool.convert import ConvertOptions, billboard_counts, convert, near_pixels
from vegtool.errors import UsageError
from vegtool.formats.gltf import level_glb
from vegtool.gl.upload import PlantBuffers
from vegtool.growth import sample
from vegtool.lighting.light import Light
from vegtool.lod import LodChain
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import client_plant, live, truth
from vegtool.measure.views import direction, framed
from vegtool.plant import Plant

pytestmark = pytest.mark.gl
OPTIONS = ConvertOptions(billboards=30, levels=3)
BY_RULE = MeasureOptions(measure="off")


@pytest.fixture(scope="module")
def bush() -> Plant:
    return sample("bush", 800)


@pytest.fixture(scope="module", params=["full", "none"])
def options(request: pytest.FixtureRequest) -> ConvertOptions:
    return replace(OPTIONS, refine=request.param)


@pytest.fixture(scope="module")
def chain(bush: Plant, options: ConvertOptions) -> LodChain:
    return convert(bush, options, BY_RULE)


def test_half_of_the_billboards_at_twice_the_distance(chain: LodChain) -> None:
    levels = chain.levels[1:]
    for level, most in zip(levels, (30, 15, 8), strict=True):
        assert len(level.billboards or ()) <= most
        assert 0 < level.triangles <= 2 * most, "of the mesh and of all billboards"
    near = [level.near_distance_m for level in levels]
    assert near[1] == pytest.approx(2 * near[0], rel=0.01), "rounded up"
    assert near[2] == pytest.approx(2 * near[1], rel=0.05)


def test_distances_double_beyond_the_size_that_pictures_are_made_for(bush: Plant) -> None:
    """A tree of few triangles is not seen from where one of twice as many is: else the coarsest
    alone would be left of those that are made for the smallest size."""
    made = convert(bush, replace(OPTIONS, billboards=16, pixels=16.0, levels=4), BY_RULE)
    near = [level.near_distance_m for level in made.levels[1:]]
    assert len(near) == 4, "16, 8, 4 and 2 pixels; made for 16, 8, 8 and 8"
    assert np.diff(np.log2(near)) == pytest.approx(1, rel=0.02), "rounded up"


def test_wood_is_a_mesh_where_levels_are_refined(chain: LodChain, options: ConvertOptions) -> None:
    """Leaves may be triangles too, then the level is a mesh and no more."""
    for level in chain.levels[1:]:
        assert (level.mesh is not None) == (options.refine == "full")
        assert level.kind in ("hybrid", "mesh", "billboards")


def test_the_first_level_may_be_for_any_size(bush: Plant) -> None:
    made = convert(bush, replace(OPTIONS, pixels=64.0, levels=2), BY_RULE)
    size = np.ptp(bush.bounds, axis=0).max()
    for level, pixels in zip(made.levels[1:], (64, 32), strict=True):
        density = made.display.pixels_per_metre(level.near_distance_m)
        assert size * density == pytest.approx(pixels, rel=0.05), "distances are rounded up"
        assert level.texels_per_metre == pytest.approx(density, rel=0.05)


@pytest.mark.parametrize(
    ("name", "value"), [("method", "kmeans"), ("shape", "single"), ("orientation_weight", 0.1)]
)
def test_options_of_the_plain_method_are_refused_where_they_do_nothing(
    name: str, value: str | float
) -> None:
    flag = "--" + name.replace("_", "-")
    with pytest.raises(UsageError, match=f"{flag}: .* --refine none"):
        replace(OPTIONS, **{name: value})
    assert getattr(replace(OPTIONS, refine="none", **{name: value}), name) == value


def test_fewer_billboards_are_made_for_smaller_sizes() -> None:
    assert near_pixels(512) == 200
    assert near_pixels(512 * 3) == pytest.approx(400)
    assert near_pixels(512 // 9) == pytest.approx(50, rel=0.02)
    sizes = [near_pixels(count) for count in range(1, 100_000, 77)]
    assert all(a <= b for a, b in pairwise(sizes))
    assert sizes[0] >= 8, "a picture needs some texels"
    assert sizes[-1] <= 1080, "no plant need be larger than the screen"


def test_one_texel_per_pixel_at_the_near_end(chain: LodChain, bush: Plant) -> None:
    level = chain.levels[1]
    size = np.ptp(bush.bounds, axis=0).max()
    density = chain.display.pixels_per_metre(level.near_distance_m)
    assert size * density == pytest.approx(near_pixels(OPTIONS.billboards), rel=0.01)
    assert level.texels_per_metre == pytest.approx(density, rel=0.01)


def test_the_original_comes_first_and_every_option_is_written_down(
    chain: LodChain, bush: Plant, options: ConvertOptions
) -> None:
    assert chain.levels[0].mesh is bush
    assert chain.options["billboards"] == 30
    names = [item.name for item in fields(ConvertOptions)]
    assert ConvertOptions(**{name: chain.options[name] for name in names}) == options
    names = [item.name for item in fields(MeasureOptions)]
    assert MeasureOptions(**{name: chain.options[name] for name in names}) == BY_RULE


@pytest.mark.parametrize("refine", ["full", "none"])
def test_no_level_costs_more_than_three_quarters_of_the_one_before(refine: str) -> None:
    """Single-sided leaves need two quads a billboard: the first level would save too little."""
    herb = sample("herb", 400)
    for double_sided in (True, False):
        materials = tuple(replace(m, double_sided=double_sided) for m in herb.materials)
        plant = replace(herb, materials=materials)
        chain = convert(plant, ConvertOptions(refine=refine), BY_RULE)
        triangles = [level.triangles for level in chain.levels]
        assert all(b <= 0.75 * a for a, b in pairwise(triangles))
        assert len(triangles) > 1


@pytest.mark.parametrize("refine", ["full", "none"])
def test_a_single_triangle_still_gets_a_level(refine: str, bush: Plant) -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    plant = Plant(
        "triangle", corners, np.tile([0.0, 0, 1], (3, 1)), np.zeros((3, 2)), [[0, 1, 2]], [0],
        bush.materials[:1],
    )  # fmt: skip
    chain = convert(plant, ConvertOptions(levels=6, refine=refine), BY_RULE)
    assert len(chain.levels) == 2
    near = chain.levels[1].near_distance_m
    assert near > 20 * plant.height, "the far one"
    size = plant.extent * chain.display.pixels_per_metre(near)
    assert size == pytest.approx(8, rel=0.01), "and no smaller: a picture needs some texels"


def test_counts_fall_by_half() -> None:
    herb = sample("herb", 400)
    counts = billboard_counts(herb, ConvertOptions(billboards=1000, levels=7))
    assert counts[0] == int(0.75 * len(herb.faces)) // 2, "a billboard is two triangles"
    assert counts[1:3] == [round(counts[0] / 2), round(counts[0] / 4)]
    assert billboard_counts(herb, ConvertOptions(billboards=2, levels=4)) == [2, 1, 1, 1]


@pytest.mark.parametrize(
    ("refine", "triangles", "mean", "each"),
    [("full", 4000, 0.05, 0.1), ("none", 800, 0.1, 0.2)],
)
def test_every_level_covers_what_the_plant_covers_in_its_colour(
    refine: str, triangles: int, mean: float, each: float
) -> None:
    """As a client draws it, from all around and above, at the distance from which it is meant;
    and double-sided leaves lit from everywhere keep their colour."""
    bush = sample("bush", triangles)
    count = 30 * triangles // 800
    options = ConvertOptions(billboards=count, levels=3, refine=refine)
    chain = convert(bush, options, BY_RULE)
    everywhere = Light(sun=0.0, sky_above=1.0, sky_below=1.0)
    for level in chain.levels[1:]:
        ratios = []
        for azimuth, elevation in ((25, 8), (115, 8), (205, 8), (295, 8), (0, 60)):
            view = direction(azimuth, elevation)
            camera = framed(bush.center, bush.radius, view, level.near_distance_m, chain.display)
            with (
                PlantBuffers(bush) as original,
                PlantBuffers(client_plant(level), mipmaps=True) as baked,
            ):
                wanted = truth(original, camera, everywhere).sum(axis=(0, 1))
                found = live(baked, camera, everywhere).sum(axis=(0, 1))
            ratios.append(found / wanted)
        color, cover = np.array(ratios)[:, :3], np.array(ratios)[:, 3]
        assert cover.mean() == pytest.approx(1.0, abs=mean)
        assert cover == pytest.approx(1.0, abs=each)
        assert color / cover[:, None] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("method", ["kmeans", "isodata", "branches"])
@pytest.mark.parametrize("shape", ["auto", "single", "crossed"])
def test_every_method_and_shape_shows_every_face(bush: Plant, method: str, shape: str) -> None:
    options = replace(OPTIONS, refine="none", method=method, shape=shape, levels=1)
    made = convert(bush, options, BY_RULE)
    level = made.levels[1]
    assert level.billboards is not None
    assert level.atlas is not None
    assert len(level.billboards) <= OPTIONS.billboards
    assert level.geometric_error_m is not None
    assert level.geometric_error_m[0] < 2 * bush.radius
    covered = level.atlas.color[..., 3].mean() / 255
    assert 0.02 < covered < 1


def test_same_seed_same_bytes(bush: Plant, chain: LodChain, options: ConvertOptions) -> None:
    again = convert(bush, options, BY_RULE)
    for one, two in zip(chain.levels[1:], again.levels[1:], strict=True):
        assert level_glb(one, "level") == level_glb(two, "level")


def test_a_plant_elsewhere_gives_the_same_levels_elsewhere(
    bush: Plant, chain: LodChain, options: ConvertOptions
) -> None:
    """Georeferenced, 5e6 metres away: positions there are exact to 1e-9 m, so labels may differ
    on ties only; what is compared is the count and the area."""
    move = np.array([5e6, 0.0, -5e6])
    moved = convert(replace(bush, positions=bush.positions + move), options, BY_RULE)
    for one, two in zip(chain.levels[1:], moved.levels[1:], strict=True):
        assert one.kind == two.kind
        assert one.triangles == pytest.approx(two.triangles, rel=0.1)
        here, there = client_plant(one), client_plant(two)
        assert here.face_areas.sum() == pytest.approx(there.face_areas.sum(), rel=0.05)
        assert np.abs(there.positions - move).max() < 2 * bush.radius


def test_a_plant_without_extent_is_refused() -> None:
    point = Plant(
        "point", np.zeros((3, 3)), np.tile([0.0, 1, 0], (3, 1)), np.zeros((3, 2)),
        [[0, 1, 2]], [0], sample("bush", 800).materials[:1],
    )  # fmt: skip
    with pytest.raises(UsageError, match="extent"):
        convert(point)
