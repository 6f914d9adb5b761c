"""Chains for the eyes of a scene: what none of them sees is not made, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np
import pytest

from vegtool.convert import ConvertOptions, convert
from vegtool.convert.seen import complete, drawn, first_needed, for_span
from vegtool.errors import QualityError
from vegtool.formats.gltf import level_glb, write_chain
from vegtool.formats.manifest import read_manifest
from vegtool.growth import sample
from vegtool.limits import Limits, Span
from vegtool.lod import Display, Level, LodChain
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
        (Span(), WANTED),
        (Span(11.4, inf), WANTED),
        (Span(11.6, inf), [(64, 10.0), *WANTED[1:]]),
        (Span(0, 19.9), WANTED[:1]),
        (Span(0, 20), WANTED[:2]),
        (Span(0, 9), []),
        (Span(22.9, 50), [(32, 19.9), *WANTED[1:3]]),
        (Span(23.1, 50), [(64, 20.0), (32, 20.0), WANTED[2]]),
        (Span(34.5, inf), [(64, 29.9), (21, 29.9), *WANTED[2:]]),
        (Span(184, inf), [(64, 159.0), (32, 159.0), (16, 159.0), (4, 159.0)]),
    ],
)
def test_levels_are_for_the_nearest_eye_and_not_beyond_the_farthest(
    span: Span, found: list[tuple[int, float]]
) -> None:
    """Who sees a plant from 34.5 m sees it as from 30 m and a fade: there, two thirds of the 32
    billboards for 20 m are enough. What comes before is made only if those err too much."""
    got = for_span(WANTED, span, fewer)
    first = first_needed(WANTED, span)
    assert got[first:] == found[first:]
    assert [count for count, _ in got[:first]] == [count for count, _ in WANTED[:first]]


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
    """Levels are for 5 m and more, 10 m, 20 m, about: who is 12 to 19 m away sees the second, whose
    atlas is then for 10.4 m, and no other."""
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
    assert [one.what[:12] for one in chain.omitted] == [
        "the original",
        "a level of u",
        "a level of u",
    ]
    assert any("left out for the scene: the original, 2 of its levels" in n for n in chain.notes)
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
    assert asked == [1, 2, 3]


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
