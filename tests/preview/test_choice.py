"""What is drawn of a landscape, against a choice made plant by plant in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np
import pytest
from instanced import AMBIENT
from walk_cases import (
    CUT_OUT,
    FOCAL_PX,
    OPAQUE,
    bush,
    crown,
    elements_of,
    garden,
    herb,
    kinds,
    plants,
    species_of,
    stock,
    tree,
    wood,
)

from vegtool.elements import ordered
from vegtool.gl.context import framebuffer_kept
from vegtool.gl.draw import begin
from vegtool.gl.instances import INSTANCE, WHOLE
from vegtool.gl.landscape import Frame, Landscape
from vegtool.gl.targets import drawing_target
from vegtool.preview.choice import (
    APPEARING,
    BEYOND,
    GROWTH,
    HIDDEN,
    LEAST_TRIANGLES,
    NEAR_SPARE,
    NO_LEVEL,
    OVERLAP,
    SHARES,
    TEXTURED,
    THINNED_PX,
    WIDEST,
    Chosen,
    Kinds,
    Seen,
    chosen,
    frame,
    seen,
    switches,
)
from vegtool.preview.correction import NONE, SIDES, Correction
from vegtool.preview.eye import Eye
from vegtool.preview.options import FadeMode
from vegtool.preview.reveal import noise, threshold_of
from vegtool.preview.stock import STOCK, Stock
from vegtool.seeding import generator
from vegtool.tiles.library import Species

MODES: tuple[FadeMode, ...] = ("none", "alpha-test", "dither")
DETAILS = (1.0, 0.5, 3.0, 1 / 16)
"""At the last of them a level is left out."""
SIZE = (64, 48)


# -- in plain words --------------------------------------------------------------------------------


@dataclass
class Kind:
    """A species at a detail. start: metres from where each level is used, of a plant of scale 1; a
    level that is left out has that of the next. fewest: triangles of the last."""

    start: list[float]
    fade: list[float]
    opaque: list[bool]
    whole: float
    coarse: float
    thinned: float
    fewest: int

    @property
    def last(self) -> int:
        return len(self.start) - 1

    @property
    def used(self) -> list[int]:
        """Levels that are not left out: those that do not end where they start."""
        return [n for n, start in enumerate(self.start) if start not in self.start[n + 1 :]]

    def before(self, level: int) -> int:
        """The level that is used before one."""
        return max(n for n in self.used if n < level)

    def end(self, level: int) -> float:
        """Where a level has come, which it has when the next one starts."""
        following = [self.start[n] for n in self.used if n > level]
        return min([self.start[level] * (1 + self.fade[level]), *following])


def side_with_room(triangles: int) -> float:
    """Pixels: n = s^2 (s^2)^HIDDEN, solved for s."""
    return float(triangles ** (1 / (2 + 2 * HIDDEN)))


def kind_of(species: Species, detail: float, focal_px: float = FOCAL_PX) -> Kind:
    triangles = [len(level.faces) for level in species.levels]
    side_px = max(np.ptp(species.levels[0].positions, axis=0)) * focal_px
    start = [0.0]
    for level in range(1, len(triangles)):
        room = side_px / side_with_room(triangles[level])
        textured = [any(m.textures for m in one.materials) for one in species.levels]
        if textured[level - 1] and not textured[level]:
            room *= TEXTURED
        stated = float(species.switch_m[level]) * focal_px / species.focal_px
        start.append(min(stated, detail * room))
    for level in range(len(start) - 1, 0, -1):  # none starts after what comes after it
        start[level - 1] = min(start[level - 1], start[level])
    room = side_px / side_with_room(triangles[-1])
    if len(triangles) > 1 and textured[-2] and not textured[-1]:
        room *= TEXTURED
    coarse = whole = detail * room
    if len(triangles) > 1:
        first = min(n for n, of in enumerate(start) if n and of not in start[n + 1 :])
        whole = start[1] * min(NEAR_SPARE * triangles[first] / triangles[0], 1.0) ** 0.5
    opaque = [all(m.alpha_mode == "opaque" for m in one.materials) for one in species.levels]
    thinned = detail * side_px / THINNED_PX
    fades = species.fade.tolist()
    return Kind(start, fades, opaque, whole, coarse, thinned, triangles[-1])


def level_at(kind: Kind, away: float) -> int:
    return max(level for level, start in enumerate(kind.start) if away >= start)


Drawn = tuple[int, float, float, float, float, bool]
"""Level, share kept, length, texels shown, share of what has none, and whether texels fade."""


def drawn_of(
    kind: Kind, away: float, mode: FadeMode, held: int | None = None, before: int | None = None
) -> list[Drawn]:
    """What is drawn of a plant that is so many times its scale away: one level, or two."""
    level, share = level_at(kind, away), 1.0
    if held is not None:
        level = min(held, kind.last)
    elif mode == "none":
        if before is not None:
            lasting = max(n for n in kind.used if away >= kind.end(n))
            level = min(max(before, lasting), level)
    elif away < kind.end(level):
        share = (away - kind.start[level]) / (kind.end(level) - kind.start[level])
    levels = [(level, share, False)]
    if share < 1:
        levels.append((kind.before(level), 1 - share, True))
    found = []
    for number, visible, leaves in levels:
        until = kind.whole if number == 0 else kind.coarse if number == kind.last else inf
        kept = 1.0 if held is not None else min((until / away) ** 2, 1.0)
        if number == kind.last and held is None:
            kept = max(kept, min(LEAST_TRIANGLES / kind.fewest, 1.0))
        length = kept**-GROWTH
        shown, solid, fading = 2.0, 1.0, share < 1
        if mode == "dither":
            if share < 1:
                shown = -(share + 1e-6) if leaves else share
        elif share < 1:
            visible = visible**OVERLAP
            if number == 0 or kind.opaque[number]:
                kept, fading = kept * visible, False
            else:
                shown, solid = float(threshold_of(np.array([visible]))[0]), visible
        found.append((number, kept * WHOLE, length, shown, solid, fading))
    return found


# -- cases -----------------------------------------------------------------------------------------


def found_at(
    species: Sequence[Species], away: np.ndarray, kind: np.ndarray, scale: float | np.ndarray = 1.0
) -> Seen:
    """Plants that far from an eye, in their scales, and none about to vanish."""
    rows = np.zeros(len(away), STOCK)
    rows["scale"], rows["vanish"], rows["species"] = scale, 1.0, kind
    rows["turn"], rows["tint"] = (1, 0), 128
    distance = (away * rows["scale"]).astype(np.float32)
    place = np.zeros((len(away), 3), np.float32)
    place[:, 2] = -distance
    spare = np.full(len(away), 100.0, np.float32)
    return Seen(rows, place, distance, spare, np.arange(len(away)), np.array([len(away)]))


def distances(seed: int, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
    """(n,) from near to far beyond the last level, and (n,) kinds."""
    rng = generator(seed, "distances")
    return np.exp(rng.uniform(np.log(1), np.log(400), count)), rng.integers(0, 3, count)


def assert_as_by_hand(
    what: Chosen, wanted: list[list[Drawn]], made: Kinds, kind: np.ndarray
) -> None:
    """All plants first, in their order, then the levels that leave."""
    count = len(wanted)
    assert what.of[:count].tolist() == list(range(count))
    assert sorted(what.of[count:]) == [i for i, one in enumerate(wanted) if len(one) == 2]
    for row, of in enumerate(what.of):
        level, kept, length, shown, solid, fading = wanted[of][int(row >= count)]
        assert what.level[row] == level
        assert what.model[row] == made.model[kind[of], level]
        assert what.kept[row] == pytest.approx(kept, rel=2e-3, abs=2e-3)
        assert what.length[row] == pytest.approx(length, rel=1e-3)
        assert what.shown[row] == pytest.approx(shown, abs=2e-3)
        assert what.solid[row] == pytest.approx(solid, abs=2e-3)
        assert bool(what.fading[row]) == fading


@pytest.mark.parametrize("detail", DETAILS)
@pytest.mark.parametrize("mode", MODES)
def test_levels_are_chosen_plant_by_plant(mode: FadeMode, detail: float) -> None:
    species, made = garden(), kinds(garden())
    away, kind = distances(1)
    scale = generator(2, "scales").uniform(0.3, 3.0, len(away))
    what = chosen(found_at(species, away, kind, scale), made, detail, mode)
    by_hand = [kind_of(one, detail) for one in species]
    wanted = [drawn_of(by_hand[k], a, mode) for a, k in zip(away, kind, strict=True)]
    assert_as_by_hand(what, wanted, made, kind)
    assert (mode == "none") == (len(what.of) == len(away)), "some fade"


@pytest.mark.parametrize("held", [0, 1, 3, 9])
def test_a_level_that_is_held_is_that_of_all_or_their_last_and_whole(held: int) -> None:
    species, made = garden(), kinds(garden())
    away, kind = distances(3)
    by_hand = [kind_of(one, 1.0) for one in species]
    for mode in MODES:
        what = chosen(found_at(species, away, kind), made, 1.0, mode, held)
        wanted = [drawn_of(by_hand[k], a, mode, held) for a, k in zip(away, kind, strict=True)]
        assert_as_by_hand(what, wanted, made, kind)
        assert not what.fading.any()


def test_a_picture_of_other_pixels_has_its_levels_elsewhere() -> None:
    """Twice the pixels, twice the distances: what is chosen is the same."""
    species = garden()
    away, kind = distances(4)
    one, two = kinds(species), kinds(species, 2 * FOCAL_PX)
    for mode in MODES:
        near = chosen(found_at(species, away, kind), one, 1.0, mode)
        far = chosen(found_at(species, 2 * away, kind), two, 1.0, mode)
        assert near.level.tolist() == far.level.tolist()
        np.testing.assert_allclose(near.kept, far.kept, atol=1e-5)


def test_detail_moves_the_distances_at_which_there_is_room() -> None:
    """Never beyond those that are stated: from them on a level is good enough."""
    made = kinds(garden())
    for detail in (1 / 64, 0.1, 0.25, 0.5, 1.0, 4.0):
        at = switches(made, detail)
        for number, one in enumerate(garden()):
            by_hand = kind_of(one, detail)
            count = len(one.levels)
            np.testing.assert_allclose(at.start[number, :count], by_hand.start, rtol=1e-6)
            for level in by_hand.used:
                assert at.end[number, level] == pytest.approx(by_hand.end(level))
                assert not level or at.before[number, level] == by_hand.before(level)
            assert at.whole_m[number] == pytest.approx(by_hand.whole)
            assert at.coarse_m[number] == pytest.approx(by_hand.coarse)
            assert (at.start[number, count:] == inf).all()


# -- hysteresis ------------------------------------------------------------------------------------


def test_a_plant_that_does_not_fade_keeps_its_level_within_the_range() -> None:
    """Back and forth over the distance, within the fade range: nothing changes, whatever it was.
    Beyond the range's end the farther level comes, and before its start the nearer one."""
    made, species = kinds((tree(),)), (tree(),)
    start, end = 8.0, 8.0 * 1.15
    kind = np.zeros(1, np.int64)

    def walk(level: int, *ways: float) -> list[int]:
        before, seen_levels = np.array([level], np.uint8), []
        for away in ways:
            at = found_at(species, np.array([away]), kind)
            before = chosen(at, made, 1.0, "none", None, before).level
            seen_levels.append(int(before[0]))
        return seen_levels

    to_and_fro = (start + 0.1, end - 0.1, start + 0.5, start + 0.1, end - 0.01)
    assert walk(0, *to_and_fro) == [0] * 5
    assert walk(1, *to_and_fro) == [1] * 5
    assert walk(0, start + 0.1, end + 0.1, end - 0.1, start + 0.1, start - 0.1, start + 0.1) == [
        0, 1, 1, 1, 0, 0,
    ]  # fmt: skip
    assert walk(NO_LEVEL, start + 0.1) == [1], "what was not there has no level to keep"
    assert walk(0, 50.0) == [2] and walk(3, 2.0) == [0], "however far it has come"


def test_hysteresis_is_that_of_each_plant() -> None:
    species, made = garden(), kinds(garden())
    away, kind = distances(5)
    before = generator(6, "before").integers(0, 4, len(away)).astype(np.uint8)
    before = np.minimum(before, made.count[kind] - 1).astype(np.uint8)
    before[::7] = NO_LEVEL
    kept = before.copy()
    what = chosen(found_at(species, away, kind), made, 1.0, "none", None, before)
    by_hand = [kind_of(one, 1.0) for one in species]
    wanted = [
        drawn_of(by_hand[k], a, "none", before=None if b == NO_LEVEL else int(b))
        for a, k, b in zip(away, kind, before, strict=True)
    ]
    assert_as_by_hand(what, wanted, made, kind)
    np.testing.assert_array_equal(before, kept)


# -- fades -----------------------------------------------------------------------------------------


def test_by_pixels_one_level_shows_what_the_other_does_not() -> None:
    """The level that comes shows values below its share, the one that leaves those from it on,
    which a minus says; nothing shows twice, as they are a millionth apart."""
    away = np.linspace(8.01, 9.19, 50)
    what = chosen(
        found_at((tree(),), away, np.zeros(50, np.int64)), kinds((tree(),)), 1.0, "dither"
    )
    assert what.fading.all() and len(what.of) == 100
    comes, leaves = what.shown[:50], what.shown[50:]
    assert (comes > 0).all() and (np.diff(comes) > 0).all()
    np.testing.assert_allclose(leaves, -comes - 1e-6, atol=1e-7)
    assert (what.level[:50] == 1).all() and (what.level[50:] == 0).all()


def test_a_fade_begins_with_one_level_and_ends_with_the_other() -> None:
    made, species = kinds((tree(),)), (tree(),)
    for level, start, end in ((1, 8.0, 9.2), (2, 20.0, 23.0), (3, 60.0, 69.0)):
        away = np.float32([start * (1 + 1e-6), end * (1 - 1e-6), end * (1 + 1e-6)])
        what = chosen(found_at(species, away, np.zeros(3, np.int64)), made, 1.0, "alpha-test")
        shares = {}
        for row in range(len(what.of)):
            opaque = made.opaque[0, what.level[row]] or what.level[row] == 0
            amount = what.kept[row] / WHOLE if opaque else what.solid[row]
            shares[int(what.of[row]), int(what.level[row])] = float(amount)
        first_alone = shares[0, level - 1]
        assert shares[0, level] < 0.01
        assert shares[1, level] > 0.99 * min(1.0, shares[2, level])
        assert shares[1, level - 1] < 0.01 < first_alone
        assert (2, level - 1) not in shares


def crowded() -> Species:
    """Six levels of which three are stated nearly at the same distance. At a detail of 0.15 there
    is room for the opaque one of them before that."""
    return species_of(
        "crowded", crown(80, 0.16, OPAQUE), crown(36, 0.24, CUT_OUT), crown(18, 0.34, CUT_OUT),
        crown(16, 0.36, OPAQUE), crown(14, 0.38, OPAQUE), crown(3, 0.6, OPAQUE),
        at=(0, 8, 14, 14.2, 14.5, 60),
    )  # fmt: skip


@pytest.mark.parametrize("detail", [1 / 64, 1 / 16, 0.1, 0.25, 0.5, 1.0, 4.0])
def test_levels_follow_each_other_in_order_at_every_detail(detail: float) -> None:
    """Where TEXTURED halves the distance of an opaque level, so that it would start before the
    textured one that it follows, that one is left out; and each has come before the next starts."""
    species = (*garden(), crowded())
    at = switches(kinds(species), detail)
    for number, one in enumerate(species):
        starts, ends = (of[number, : len(one.levels)] for of in (at.start, at.end))
        assert (np.diff(starts) >= 0).all() and (np.diff(ends) >= 0).all()
        assert (ends >= starts).all()
        for level, start in enumerate(starts):
            later = [s for s in starts[level + 1 :] if s > start]
            assert ends[level] <= min(later, default=inf), f"level {level} of {one.name}"


def test_a_level_that_is_left_out_is_never_drawn() -> None:
    """From near to far, and whichever of the others was drawn before."""
    species, detail = (crowded(),), 0.15
    made, by_hand = kinds(species), kind_of(crowded(), detail)
    assert by_hand.used == [0, 1, 3, 4, 5] and by_hand.end(3) == by_hand.start[4]
    away = np.exp(np.linspace(np.log(1), np.log(100), 2000))
    found = found_at(species, away, np.zeros(len(away), np.int64))
    for mode in MODES:
        for before in (None, *by_hand.used):
            was = None if before is None else np.full(len(away), before, np.uint8)
            what = chosen(found, made, detail, mode, None, was)
            assert {*what.level.tolist()} <= {*by_hand.used}, (mode, before)


def test_a_level_has_come_before_the_next_one_starts() -> None:
    """Stated at 8 and 8.5 metres, so that the first would have come at 9.2."""
    close = species_of(
        "close", crown(80, 0.16, tree().levels[0].materials[0]), *tree().levels[1:3], at=(0, 8, 8.5)
    )
    at = switches(kinds((close,)), 1.0)
    assert at.start[0, 2] >= at.end[0, 1]


# -- stages ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("detail", [0.5, 1.0, 4.0])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_stages_rise_with_distance_and_have_no_steps(number: int, detail: float) -> None:
    """From 0.5, whole, up to the last level and its whole way beyond."""
    made = kinds(garden())
    at = switches(made, detail)
    away = np.exp(np.linspace(np.log(0.01), np.log(1e5), 200_001)).astype(np.float32)
    stage = at.stage(np.full(len(away), number), away)
    assert (np.diff(stage) >= 0).all()
    assert np.diff(stage).max() < 0.005, "8e-5 of a distance, a 0.15th of which is half a stage"
    assert stage[0] == 0.5 and stage[-1] == made.count[number]


@pytest.mark.parametrize("detail", [0.6, 1.0, 2.0, 4.0])
def test_stages_at_the_ends_of_fades_do_not_depend_on_detail(detail: float) -> None:
    """A level begins to come at a whole stage, and has come at a half."""
    made = kinds(garden())
    at = switches(made, detail)
    for number, count in enumerate(made.count):
        for level in range(1, count):
            ends = np.float32([at.start[number, level], at.end[number, level]])
            stage = at.stage(np.full(2, number), ends)
            np.testing.assert_allclose(stage, [level, level + 0.5], atol=1e-6)
        whole = at.whole_m[[number]]
        assert at.stage(np.array([number]), whole)[0] == pytest.approx(0.5)
        last = float(at.end[number, count - 1] if count > 1 else at.whole_m[number])
        far = at.stage(np.array([number]), np.float32([BEYOND * last]))
        assert far[0] == pytest.approx(count)


def test_lengths_are_corrected_along_stages() -> None:
    """By what lies between the two nearest stages and sides; a level that is held is not."""
    species, made = garden(), kinds(garden())
    stages, factors = np.array([0.5, 1.0, 1.5, 2.5]), np.array([1.1, 1.2, 1.4, 0.9])
    sides = 1 + 0.1 * np.cos(2 * np.pi * np.arange(SIDES) / SIDES)
    correction = Correction(stages, factors[:, None] * sides)
    corrected = replace(made, corrections=(NONE, correction, NONE))
    away, kind = distances(7)
    found = found_at(species, away, kind)
    plain, what = (
        chosen(found, made, 1.0, "alpha-test"),
        chosen(found, corrected, 1.0, "alpha-test"),
    )
    at = switches(made, 1.0)
    for row, of in enumerate(what.of):
        factor = 1.0
        if kind[of] == 1:
            stage = float(at.stage(kind[[of]], away[[of]].astype(np.float32))[0])
            factor = float(np.interp(stage, stages, factors))
            x, _, z = found.place[of].astype(float)
            cos, sin = found.rows["turn"][of].astype(float)
            turned = (np.arctan2(sin, cos) + np.pi - np.arctan2(x, z)) / (2 * np.pi) * SIDES
            factor *= float(np.interp(turned % SIDES, np.arange(SIDES + 1), [*sides, sides[0]]))
        assert what.length[row] == pytest.approx(plain.length[row] * factor, rel=1e-4)
    held = chosen(found, corrected, 1.0, "alpha-test", 0)
    np.testing.assert_array_equal(held.length, chosen(found, made, 1.0, "alpha-test", 0).length)


# -- what is seen ----------------------------------------------------------------------------------


def stocks_of(species: Sequence[Species], made: Kinds, **given: int) -> list[Stock]:
    placement = wood(**given)
    return [stock(of, species, made) for of in placement.given]


def seen_by_hand(
    stocks: Sequence[Stock], species: Sequence[Species], eye: Eye, detail: float
) -> set[tuple[int, int]]:
    """(tile, row) of plants whose sphere reaches into the view, and that have not vanished yet."""
    found = set()
    for tile, one in enumerate(stocks):
        for row, plant in enumerate(one.rows):
            kind = species[plant["species"]]
            low, high = kind.levels[0].bounds
            up = float(low[1] + high[1]) / 2 * float(plant["scale"])
            middle = one.origin + plant["offset"].astype(np.float64) + (0, up, 0) - eye.position
            across = max(abs(v) for v in (low[0], high[0])), max(abs(v) for v in (low[2], high[2]))
            radius = float(plant["scale"]) * np.sqrt(
                across[0] ** 2 + across[1] ** 2 + ((high[1] - low[1]) / 2) ** 2
            )
            inside = all(
                a * middle[0] + b * middle[1] + c * middle[2] + d > -radius
                for a, b, c, d in eye.planes(*SIZE)
            )
            reach = kind_of(kind, detail).thinned * float(plant["scale"]) * float(plant["vanish"])
            if inside and np.linalg.norm(middle) < reach:
                found.add((tile, row))
    return found


EYES = {
    "within": Eye(np.array([0.5, 1.5, 0.5]), 30.0, -5.0),
    "outside": Eye(np.array([0.0, 6.0, 60.0]), 0.0, -8.0),
    "far": Eye(np.array([90.0, 30.0, 150.0]), 30.0, -10.0),
    "away": Eye(np.array([0.0, 6.0, 60.0]), 180.0, 20.0),
    "near-sighted": Eye(np.array([0.0, 1.0, 30.0]), far_m=25.0),
    "everywhere": Eye(np.array([0.0, 1.0, 30.0]), far_m=inf),
}


@pytest.mark.parametrize("eye", list(EYES))
@pytest.mark.parametrize("detail", [1.0, 0.3])
def test_plants_are_seen_that_reach_into_the_view_and_have_not_vanished(
    eye: str, detail: float
) -> None:
    species, made = garden(), kinds(garden())
    stocks = stocks_of(species, made, tiles=4, count=30)
    here = EYES[eye]
    near = np.zeros(len(stocks))
    found = seen(stocks, near, here.position, here.planes(*SIZE), made, detail)
    firsts = np.cumsum([0, *found.counts])
    tile = np.searchsorted(firsts, found.index, side="right") - 1
    pairs = {(int(t), int(i - firsts[t])) for t, i in zip(tile, found.index, strict=True)}
    assert pairs == seen_by_hand(stocks, species, here, detail)
    for row, (t, i) in zip(range(len(found.rows)), sorted(pairs), strict=True):
        plant = stocks[t].rows[i]
        assert found.rows[row] == plant
        place = stocks[t].origin + plant["offset"] - here.position
        np.testing.assert_allclose(found.place[row], place, atol=1e-4)
        middle = place + np.array([0, made.center[plant["species"]] * plant["scale"], 0])
        assert found.distance[row] == pytest.approx(np.linalg.norm(middle), rel=1e-4)
        reach = made.thinned_m[plant["species"]] * detail * plant["scale"] * plant["vanish"]
        assert found.spare[row] == pytest.approx(reach / found.distance[row], rel=1e-4)


def test_how_near_a_tile_is_leaves_nothing_out() -> None:
    """Only its first plants are looked at, and none of the others would have been drawn."""
    species, made = garden(), kinds(garden())
    stocks = stocks_of(species, made, tiles=4, count=30)
    eye = Eye(np.array([0.0, 6.0, 160.0]), 0.0, -3.0)
    feet = [one.origin + one.rows["offset"] for one in stocks]
    margin = 2.0 * float((made.radius + made.center).max())
    near = np.array(
        [
            np.linalg.norm(
                np.clip(eye.position, f.min(0) - margin, f.max(0) + margin) - eye.position
            )
            for f in feet
        ]
    )
    planes = eye.planes(*SIZE)
    all_of = seen(stocks, np.zeros(len(stocks)), eye.position, planes, made, 0.5)
    first = seen(stocks, near, eye.position, planes, made, 0.5)
    assert len(first.rows) and first.counts.sum() < all_of.counts.sum()
    np.testing.assert_array_equal(first.rows, all_of.rows)
    np.testing.assert_array_equal(first.distance, all_of.distance)


def test_far_away_as_many_are_left_as_have_room_and_are_wider() -> None:
    """Of 500 herbs in one place: all up to the distance at which one has room for two triangles, a
    quarter at twice, a sixteenth at four times; each as wide as it stands for, 1 / share to the
    power of GROWTH, until it is about to vanish."""
    species = (herb(),)
    made = kinds(species)
    one = stock(plants(np.zeros((500, 3))), species, made)
    limit = float(made.thinned_m[0])
    for times, share in ((0.9, 1.0), (2.0, 1 / 4), (4.0, 1 / 16)):
        eye = Eye(np.array([0.0, float(made.center[0]), times * limit]))
        found = seen([one], np.zeros(1), eye.position, eye.planes(*SIZE), made, 1.0)
        assert len(found.rows) == pytest.approx(500 * share, abs=1)
        what = chosen(found, made, 1.0, "none")
        rows = frame(found, what).rows
        width = np.sort(rows["shown"][:, 1])
        expected = min(max(share, 0.0) ** -GROWTH, WIDEST)
        assert width[-1] == pytest.approx(expected, rel=0.01)
        about = (found.spare < 1 + APPEARING).sum()
        assert (width < expected * 0.99).sum() == pytest.approx(about, abs=2)


def test_widths_grow_from_nothing_where_a_plant_appears() -> None:
    species = (herb(),)
    made = kinds(species)
    one = stock(plants(np.zeros((1, 3))), species, made)
    limit = float(made.thinned_m[0])
    for times, width in ((0.999999, 0), (1 / (1 + APPEARING / 2), 0.5), (1 / (1 + APPEARING), 1)):
        eye = Eye(np.array([0.0, float(made.center[0]), times * limit]))
        found = seen([one], np.zeros(1), eye.position, eye.planes(*SIZE), made, 1.0)
        (row,) = frame(found, chosen(found, made, 1.0, "none")).rows
        assert row["shown"][1] == pytest.approx(width, abs=1e-3)


# -- frames ----------------------------------------------------------------------------------------


def seen_of_a_wood(seed: int = 0) -> tuple[Seen, Kinds]:
    species = garden()
    made = kinds(species)
    stocks = [stock(of, species, made) for of in wood(6, 40, 10.0, seed).given]
    eye = Eye(np.array([3.0, 2.0, 25.0]), 10.0, -4.0)
    found = seen(stocks, np.zeros(len(stocks)), eye.position, eye.planes(*SIZE), made, 1.0)
    return found, made


@pytest.mark.parametrize("mode", MODES)
def test_batches_are_every_row_once_and_keep_the_most_of_any(mode: FadeMode) -> None:
    found, made = seen_of_a_wood()
    what = chosen(found, made, 0.5, mode)
    drawn = frame(found, what)
    covered = sorted(i for b in drawn.batches for i in range(b.first, b.first + b.count))
    assert covered == list(range(len(what.of))) == list(range(len(drawn.rows)))
    rows_of = {}
    for row, of in enumerate(what.of):
        key = (*found.place[of].tolist(), float(np.float32(what.kept[row])), int(what.model[row]))
        rows_of.setdefault(key, []).append(row)
    nearest = []
    for batch in drawn.batches:
        part = drawn.rows[batch.first : batch.first + batch.count]
        kept = part["turn"][:, 2]
        assert batch.share == pytest.approx(kept.max())
        assert (kept > batch.share / SHARES * 0.999).all() or batch.share >= 1
        distance = []
        for row in part:
            key = (*row["place"][:3].tolist(), float(row["turn"][2]), batch.plant)
            source = rows_of[key].pop()
            of = what.of[source]
            assert batch.plant == what.model[source] and batch.fading == what.fading[source]
            distance.append(float(found.distance[of]))
            plant = found.rows[of]
            assert row["place"][3] == plant["scale"] and (row["turn"][:2] == plant["turn"]).all()
            assert row["turn"][3] == pytest.approx(what.length[source])
            assert row["shown"][0] == pytest.approx(what.shown[source])
            assert row["shown"][2] == pytest.approx(what.solid[source])
            assert (row["tint"] == plant["tint"]).all()
        nearest.append(min(distance))
    assert nearest == sorted(nearest), "what hides most is drawn first"
    assert len({(b.plant, b.fading, b.share) for b in drawn.batches}) == len(drawn.batches)


def test_no_batch_draws_much_more_than_its_rows_need() -> None:
    """Elements that a row does not keep are drawn too, of size 0: less than one in SHARES."""
    found, made = seen_of_a_wood()
    what = chosen(found, made, 0.5, "alpha-test")
    triangles = np.concatenate([row[:n] for row, n in zip(made.triangles, made.count, strict=True)])
    asked = sum(triangles[b.plant] * min(b.share, 1) * b.count for b in frame(found, what).batches)
    needed = (triangles[what.model] * np.minimum(what.kept, 1)).sum()
    assert needed <= asked <= SHARES * needed


def test_paint_replaces_tints() -> None:
    found, made = seen_of_a_wood()
    what = chosen(found, made, 1.0, "alpha-test")
    paint = generator(1, "paint").integers(0, 256, (len(what.of), 4)).astype(np.uint8)
    drawn = frame(found, what, paint)
    assert sorted(map(tuple, drawn.rows["tint"].tolist())) == sorted(map(tuple, paint.tolist()))


# -- extremes --------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", MODES)
def test_nothing_is_nothing(mode: FadeMode) -> None:
    made = kinds(garden())
    eye = EYES["within"]
    empty = seen([], np.zeros(0), eye.position, eye.planes(*SIZE), made, 1.0)
    away = EYES["away"]
    stocks = stocks_of(garden(), made, tiles=2, count=3)
    unseen = seen(stocks, np.full(4, 1e9), away.position, away.planes(*SIZE), made, 1.0)
    for found in (empty, unseen):
        what = chosen(found, made, 1.0, mode)
        drawn = frame(found, what)
        assert len(found.rows) == len(what.of) == len(drawn.rows) == 0 and drawn.batches == ()
        assert drawn.rows.dtype == INSTANCE


@pytest.mark.parametrize("mode", MODES)
def test_a_plant_at_the_eye_is_drawn_whole(mode: FadeMode) -> None:
    species = (tree(),)
    made = kinds(species)
    one = stock(plants(np.zeros((1, 3))), species, made)
    eye = Eye(np.array([0.0, float(made.center[0]), 0.0]))
    found = seen([one], np.zeros(1), eye.position, eye.planes(*SIZE), made, 1.0)
    what = chosen(found, made, 1.0, mode)
    assert found.distance[0] > 0 and np.isfinite(found.spare[0])
    assert (what.level.tolist(), what.kept.tolist()) == ([0], [pytest.approx(WHOLE)])
    assert np.isfinite(frame(found, what).rows["place"]).all()


@pytest.mark.parametrize("size", [1e-4, 1e4])
def test_any_size_is_chosen_as_any_other(size: float) -> None:
    """Plants and distances all so many times as large, by a plant's height or by its model's."""
    species, made = garden(), kinds(garden())
    away, kind = distances(8, 200)
    usual = chosen(found_at(species, away, kind), made, 1.0, "alpha-test")
    scaled = chosen(found_at(species, away, kind, size), made, 1.0, "alpha-test")
    grown = tuple(
        replace(
            one,
            levels=tuple(replace(p, positions=size * p.positions) for p in one.levels),
            switch_m=size * one.switch_m,
        )
        for one in species
    )
    found = found_at(grown, size * away, kind)
    large = chosen(found, kinds(grown), 1.0, "alpha-test")
    for other in (scaled, large):
        np.testing.assert_array_equal(usual.level, other.level)
        np.testing.assert_allclose(usual.kept, other.kept, rtol=1e-3, atol=1e-3)
        np.testing.assert_allclose(usual.shown, other.shown, atol=2e-3)


def test_inputs_stay_and_the_same_is_chosen_to_the_bit() -> None:
    species, made = garden(), kinds(garden())
    stocks = stocks_of(species, made, tiles=3, count=20)
    before = [(s.rows.tobytes(), s.origin.tobytes(), s.reach.tobytes()) for s in stocks]
    eye = EYES["outside"]
    results = []
    for _ in range(2):
        found = seen(stocks, np.zeros(9), eye.position, eye.planes(*SIZE), made, 1.0)
        kept = found.rows.tobytes(), found.place.tobytes(), found.distance.tobytes()
        what = chosen(found, made, 1.0, "alpha-test")
        drawn = frame(found, what)
        assert kept == (found.rows.tobytes(), found.place.tobytes(), found.distance.tobytes())
        results.append((drawn.rows.tobytes(), drawn.batches))
    assert results[0] == results[1]
    assert before == [(s.rows.tobytes(), s.origin.tobytes(), s.reach.tobytes()) for s in stocks]


# -- drawn -----------------------------------------------------------------------------------------


def triangles_drawn(landscape: Landscape, drawn: Frame) -> dict[int, int]:
    """By model, as OpenGL counts them."""
    ctx, found = landscape.ctx, {}
    eye = Eye(np.zeros(3))
    for batch in drawn.batches:
        query = ctx.query(primitives=True)
        with framebuffer_kept(ctx):
            begin(drawing_target(ctx, SIZE, 0), SIZE)
            with query:
                landscape.draw(Frame(drawn.rows, (batch,)), eye.shot(*SIZE), AMBIENT)
        found[batch.plant] = found.get(batch.plant, 0) + query.primitives
    return found


@pytest.mark.gl
def test_near_and_fading_plants_draw_real_geometry() -> None:
    """Near, all triangles of the plant itself; while it fades, the first part of them and triangles
    of the level; far, none of them."""
    species = (tree(),)
    made, (elements,) = kinds(species), elements_of(species)
    original, level = (len(plant.faces) for plant in species[0].levels[:2])
    with Landscape(noise()) as landscape:
        for plant, order in zip(species[0].levels, elements, strict=True):
            landscape.add(plant, order)
        for mode in MODES[1:]:

            def drawn_at(away: float, mode: FadeMode = mode) -> tuple[dict[int, int], Chosen]:
                found = found_at(species, np.array([away]), np.zeros(1, np.int64))
                what = chosen(found, made, 1.0, mode)
                return triangles_drawn(landscape, frame(found, what)), what

            near, _ = drawn_at(4.0)
            assert near == {0: original}
            fading, what = drawn_at(8.6)
            assert set(fading) == {0, 1} and what.level.tolist() == [1, 0]
            assert fading[1] == level
            ranks = ordered(species[0].levels[0]).face_rank
            assert 0 < fading[0] == (ranks < what.kept[1]).sum() <= original
            if mode == "alpha-test":
                assert fading[0] < original
            far, _ = drawn_at(9.3)
            assert far == {1: level}
            for away, number in ((22.0, {1, 2}), (40.0, {2}), (65.0, {2, 3}), (300.0, {3})):
                assert set(drawn_at(away)[0]) == number


def test_what_is_kept_of_the_original_shrinks_while_it_fades() -> None:
    away = np.linspace(8.01, 9.19, 30)
    what = chosen(
        found_at((tree(),), away, np.zeros(30, np.int64)), kinds((tree(),)), 1.0, "alpha-test"
    )
    original = what.kept[30:]
    assert (what.level[30:] == 0).all() and (np.diff(original) < 0).all()
    assert original[0] > 0.8 and original[-1] < 0.06


def test_one_level_at_all_distances_is_kept_as_far_as_there_is_room() -> None:
    """Of a plant without levels: so many triangles as there is room for in its square, as its side
    goes with their number to a power."""
    species = (bush(),)
    alone = species_of("alone", species[0].levels[0])
    made = kinds((alone,))
    for away in (2.0, 30.0, 60.0, 120.0):
        found = found_at((alone,), np.array([away]), np.zeros(1, np.int64))
        what = chosen(found, made, 1.0, "alpha-test")
        faces = len(alone.levels[0].faces)
        side_px = alone.levels[0].extent * FOCAL_PX / away
        room = min((side_px / side_with_room(faces)) ** 2, 1.0)
        room = max(room, min(LEAST_TRIANGLES / faces, 1.0))
        assert what.kept[0] == pytest.approx(WHOLE * room, rel=1e-3)
        assert what.length[0] == pytest.approx(room**-GROWTH, rel=1e-3)
