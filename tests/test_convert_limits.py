"""Chains for the eyes of a scene: what none of them sees is not made, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from vegtool.convert import ConvertOptions, convert
from vegtool.convert.seen import complete, drawn, tries
from vegtool.convert.textures import nearest_m, seen_textures, texels_per_metre
from vegtool.errors import QualityError
from vegtool.formats.gltf import level_glb, write_chain
from vegtool.formats.manifest import read_manifest
from vegtool.growth import sample
from vegtool.limits import Limits, Span
from vegtool.lod import FADE_FRACTION, Display, Level, LodChain
from vegtool.measure.contact_sheet import contact_sheet
from vegtool.measure.distances import rounded_down, switch_distances
from vegtool.measure.options import MeasureOptions
from vegtool.plant import Plant
from vegtool.seeding import generator
from vegtool.tiles.library import read_species

OPTIONS = ConvertOptions(billboards=30, levels=3, refine="none", method="kmeans")
BY_RULE = MeasureOptions(measure="off")
WANTED = [(64, 10.0), (32, 20.0), (16, 40.0), (8, 80.0)]
"""Levels that replace each other at the end of a fade of 15 %: at 11.5, 23, 46 and 92 m."""


def fewer(count: int, near_m: float, at_m: float) -> int:
    return round(count * near_m / at_m)


def limits(nearest_m: float, farthest_m: float = inf, display: Display | None = None) -> Limits:
    around, up = (0.0, 360.0), (-90.0, 90.0)
    return Limits("abc", nearest_m, farthest_m, around, up, display or Display())


@pytest.mark.parametrize(
    ("span", "found"),
    [
        (Span(), [WANTED]),
        (Span(11.4, inf), [WANTED]),
        (Span(11.6, inf), [[(63, 10.1), *WANTED[1:]], [(64, 10.0), *WANTED[1:]], WANTED]),
        (Span(0, 19.9), [WANTED[:1]]),
        (Span(0, 20), [WANTED[:2]]),
        (Span(0, 9), [[]]),
        (
            Span(34.5, 79),
            [
                [(21, 29.9), (16, 40.0)],
                [(42, 29.9), (16, 40.0)],
                [(64, 29.9), (16, 40.0)],
                [(64, 29.9), (32, 29.9), (16, 40.0)],
            ],
        ),
    ],
)
def test_levels_are_for_the_nearest_eye_and_not_beyond_the_farthest(
    span: Span, found: list[list[tuple[int, float]]]
) -> None:
    """Who sees a plant from 34.5 m sees it as from 30 m and a fade: there, two thirds of the 32
    billboards for 20 m are enough. Where they err too much, twice as many are tried; at last all
    levels, beside the original."""
    got = list(tries(WANTED, span, fewer))
    if span.nearest_m == 11.6:  # made for 10 m and hardly more
        assert got == [[(64, 10.0), *WANTED[1:]], WANTED]
    else:
        assert got == found


def level_at(near_m: float) -> Level:
    from plants import plant_of

    return Level("mesh", mesh=plant_of(np.eye(3)[None]), near_distance_m=near_m)


def test_levels_that_some_eye_sees() -> None:
    levels = [level_at(near) for near in (10.0, 20.0, 40.0)]

    def kept(nearest_m: float, farthest_m: float) -> list[float]:
        span = Span(nearest_m, farthest_m)
        return [level.near_distance_m for level in drawn(levels, span)]

    assert kept(0, inf) == [10, 20, 40]
    assert kept(22.9, 39) == [10, 20] and kept(23.1, 40) == [20, 40]
    assert kept(500, inf) == [40] and kept(0, 9) == []
    assert complete(levels, Span(11.6, inf)) and not complete(levels, Span(11.4, inf))
    assert not complete([], Span(100, inf))


def test_errors_beyond_the_farthest_eye_do_not_count() -> None:
    """A level that errs too much from 40 m on may be used from 10 m on by who is within 20 m."""
    distance_m = np.array([10.0, 20.0, 40.0])
    errors, limit = [np.array([0.0, 0.0, 1.0])], np.full(3, 0.5)
    assert not isinstance(switch_distances(distance_m, errors, limit)[0], float)
    assert switch_distances(distance_m, errors, limit, farthest_m=20.0) == (10.0,)


def test_rounded_down() -> None:
    assert [rounded_down(x) for x in (0, 1.2345, 98.76, 1234.0)] == [0, 1.23, 98.7, 1230.0]


@pytest.fixture(scope="module")
def bush() -> Plant:
    return sample("bush", 800)


@pytest.fixture(scope="module")
def whole(bush: Plant) -> LodChain:
    return convert(bush, OPTIONS, BY_RULE)


@pytest.mark.gl
def test_who_may_be_anywhere_gets_the_same(bush: Plant, whole: LodChain) -> None:
    again = convert(bush, OPTIONS, BY_RULE, limits=limits(0.0))
    assert again.plant is None and again.omitted == ()
    for one, two in zip(whole.levels, again.levels, strict=True):
        assert level_glb(one, "bush") == level_glb(two, "bush")


@pytest.mark.gl
def test_nothing_is_baked_that_no_eye_sees(
    bush: Plant, whole: LodChain, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each level is for twice the distance of the one before: who is 1.2 to 1.9 times as far away
    as where the second begins sees that alone, and its atlas is for there then."""
    from vegtool.convert.makers import Maker

    made = []
    make = Maker.__call__
    monkeypatch.setattr(
        Maker, "__call__", lambda self, count, near, progress: made.append((count, near))
        or make(self, count, near, progress),
    )  # fmt: skip
    near = [level.near_distance_m for level in whole.levels]
    nearest, farthest = 1.2 * near[2], 0.99 * near[3]
    chain = convert(bush, OPTIONS, BY_RULE, limits=limits(nearest, farthest))
    at_m = rounded_down(Span(nearest).replaced_m)
    assert made == [(round(15 * near[2] / at_m), at_m)]
    (only,) = chain.levels
    assert only.near_distance_m == 0 and only.triangles <= whole.levels[2].triangles
    assert chain.plant is bush and chain.original is bush
    assert chain.omitted[0].what == "the original"
    assert ["in its place" in one.why for one in chain.omitted] == [False, False, True, False]
    assert any("left out for the scene: the original, 3 of its levels" in n for n in chain.notes)
    assert contact_sheet(chain)


@pytest.mark.gl
def test_near_eyes_keep_the_original(bush: Plant, whole: LodChain) -> None:
    near = [level.near_distance_m for level in whole.levels]
    chain = convert(bush, OPTIONS, BY_RULE, limits=limits(0.0, 0.9 * near[1]))
    assert len(chain.levels) == 1 and chain.levels[0].mesh is bush and contact_sheet(chain)
    chain = convert(bush, OPTIONS, BY_RULE, limits=limits(1.1 * near[1], near[2]))
    assert [level.near_distance_m for level in chain.levels] == near[:3], "it is still fading"


@pytest.mark.gl
@pytest.mark.parametrize("seed", range(3))
def test_the_same_levels_are_chosen(
    bush: Plant, whole: LodChain, tmp_path: Path, seed: int
) -> None:
    """For random eyes within the limits. Levels are told apart by their distances, the first by
    whose it is."""
    rng = generator(seed, "eyes")
    last = whole.levels[-1].near_distance_m
    nearest = last * float(rng.uniform(0, 2))
    farthest = nearest + last * float(rng.uniform(0.01, 2))
    chain = convert(bush, OPTIONS, BY_RULE, limits=limits(nearest, farthest))
    write_chain(chain, tmp_path)
    found = read_species(tmp_path / f"{chain.name}.lod.json")
    all_m = np.array([level.near_distance_m for level in whole.levels])
    eyes = rng.uniform(nearest, farthest, 200)
    wanted = all_m[(eyes[:, None] >= all_m).sum(axis=1) - 1]
    own_m = found.switch_m.copy()
    if chain.plant is not None:
        own_m[0] = all_m[(nearest >= all_m).sum() - 1]
    got = own_m[(eyes[:, None] >= found.switch_m).sum(axis=1) - 1]
    there = np.isin(wanted, own_m)
    np.testing.assert_array_equal(got[there], wanted[there])
    assert there.any()
    assert found.height == pytest.approx(bush.bounds[1, 1])


@pytest.mark.gl
def test_another_display(bush: Plant, whole: LodChain) -> None:
    """On a picture of twice the height, plants are seen as from half as far away on the chain's."""
    near = whole.levels[2].near_distance_m
    tall = Display(60.0, 2160)
    chain = convert(bush, OPTIONS, BY_RULE, limits=limits(2.4 * near, 2.5 * near, tall))
    alone = convert(bush, OPTIONS, BY_RULE, limits=limits(1.2 * near, 1.25 * near))
    assert [level.triangles for level in chain.levels] == [
        level.triangles for level in alone.levels
    ]


@pytest.mark.gl
def test_what_errs_too_much_has_a_finer_one_before_it(
    bush: Plant, monkeypatch: pytest.MonkeyPatch
) -> None:
    """At last the original: where no level keeps to the limit and the user set it, that is said."""
    from vegtool.measure import chain as measuring

    asked = []

    def none_keeps(plant: Plant, levels: list[Level], *others: object) -> None:
        asked.append(len(levels))
        raise QualityError("none")

    monkeypatch.setattr(measuring, "with_distances", none_keeps)
    with pytest.raises(QualityError, match="none"):
        convert(bush, OPTIONS, BY_RULE, limits=limits(1e4))
    assert asked[-1] == 3 and set(asked[:-1]) == {1}, "and one alone before"


@pytest.mark.gl
def test_measured_levels_are_enough_and_begin_where_they_did(bush: Plant) -> None:
    """The first has faded in before the nearest eye comes, and errs no more than the limit there;
    coarser ones are used from where they are without a scene."""
    measure = MeasureOptions(max_error=0.3)
    whole = convert(bush, OPTIONS, measure)
    near = [level.near_distance_m for level in whole.levels]
    nearest = 1.4 * near[1]
    chain = convert(bush, OPTIONS, measure, limits=limits(nearest))
    assert chain.plant is bush
    first, *others = chain.levels
    assert first.measured is not None and first.measured.errors["flip"].mean <= 0.3
    from_m = bush.extent * Display().pixels_per_metre(1.0) / first.measured.pixels
    assert from_m * (1 + FADE_FRACTION) < nearest
    assert {level.near_distance_m for level in others} <= set(near)


@pytest.mark.gl
def test_surfels_stand_beside_triangles(bush: Plant, tmp_path: Path) -> None:
    """Of them alone, no viewer makes a picture that is right from near: the original is kept."""
    how = ConvertOptions(method="surfels", points=500, levels=2)
    chain = convert(bush, how, BY_RULE, limits=limits(1e4))
    assert chain.plant is None and [level.kind for level in chain.levels] == ["mesh", "surfels"]
    write_chain(chain, tmp_path)
    one = read_species(tmp_path / f"{chain.name}.lod.json")
    assert one.whole and one.surfels is not None and len(one.levels) == 1


@pytest.mark.gl
def test_the_manifest_says_so(bush: Plant, tmp_path: Path) -> None:
    chain = convert(bush, OPTIONS, BY_RULE, limits=limits(1000.0, 3000.0))
    write_chain(chain, tmp_path / "a")
    write_chain(replace(chain), tmp_path / "b")
    path = tmp_path / "a" / f"{chain.name}.lod.json"
    assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes()
    told = read_manifest(path)
    scene = told["scene"]
    assert (scene["nearest_m"], scene["farthest_m"], scene["digest"]) == (1000.0, 3000.0, "abc")
    assert scene["bounds_m"] == bush.bounds.tolist() and told["extent_m"] == bush.extent
    assert not scene["original"] and scene["left_out"][0]["what"] == "the original"
    assert told["levels"][0]["switch_distance_m"] == 0
    assert told["levels"][0]["file"] == told["combined"]["file"]


def carded(texels: int, side_m: float, alpha: np.ndarray | None = None) -> Plant:
    """An upright card of so many metres about the origin, with a texture of so many texels."""
    from vegtool.plant import Material, Texture

    pixels = generator(0, "texels").integers(0, 256, (texels, texels, 4), np.uint8)
    if alpha is not None:
        pixels[..., 3] = alpha
    corners = (np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) - [0.5, 0.5, 0]) * side_m
    uvs = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float64)
    leaf = Material("leaf", color_texture=Texture("leaf", pixels), alpha_mode="mask", role="leaf")
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    normals = np.tile([0.0, 0.0, 1.0], (4, 1))
    return Plant("card", corners, normals, uvs, faces, np.zeros(2, np.int32), (leaf,))


def test_texels_that_are_smaller_than_a_pixel() -> None:
    """64 texels on 2 m are 32 to the metre. From 60 m, a metre is 15.6 pixels, and some
    more of what is nearer than the middle: half of the texels do, a quarter from 120 m on."""
    card = carded(64, 2.0, np.full((64, 64), 255))
    textures = [
        seen_textures(card, limits(nearest)).materials[0].color_texture
        for nearest in (20.0, 58.0, 64.0, 120.0, 1e9)
    ]
    assert [len(one.pixels) for one in textures if one is not None] == [64, 64, 32, 16, 4]
    assert seen_textures(card, limits(20.0)) is card
    np.testing.assert_allclose(texels_per_metre(card, np.arange(2), textures[0]), 32.0)


def test_no_eye_is_nearer_to_a_face() -> None:
    """Eyes drawn at random: anywhere, or up to 10 degrees above the horizon and 5 below."""
    rng = generator(3, "faces")
    plant = carded(8, 3.0)
    plant = replace(plant, positions=rng.uniform(-2, 2, (4, 3)))
    for low, high in ((-90.0, 90.0), (-5.0, 10.0), (20.0, 60.0)):
        where = replace(limits(2.5, 4.0), elevation_deg=(low, high), middle_m=(0.3, 0.5, -0.2))
        bound = nearest_m(plant, where)
        angle, turn = np.radians(rng.uniform(low, high, 3000)), rng.uniform(0, 2 * np.pi, 3000)
        away = rng.uniform(2.5, 4.0, 3000)
        flat = np.cos(angle)
        eyes = np.stack([flat * np.sin(turn), np.sin(angle), flat * np.cos(turn)], 1)
        eyes = eyes * away[:, None] + where.middle_m
        shares = rng.dirichlet(np.ones(3), 40)
        points = np.einsum("sk,fki->fsi", shares, plant.corners)
        apart = np.linalg.norm(points[:, :, None] - eyes, axis=3).min(axis=(1, 2))
        assert (bound <= apart).all() and bound.max() <= 4.0


@pytest.mark.parametrize(("leaf", "side"), [(1, 64), (16, 16)])
def test_as_much_of_a_smaller_texture_is_cut_out(leaf: int, side: int) -> None:
    """Squares of some texels on a chequerboard: of those of one texel, averages would show nothing
    or all; squares of many texels stay what they are."""
    at = np.arange(64) // leaf
    alpha = np.where((at[:, None] + at) % 2 == 0, 255, 0)
    card = carded(64, 2.0, alpha)
    small = seen_textures(card, limits(120.0)).materials[0].color_texture
    assert small is not None and len(small.pixels) == side
