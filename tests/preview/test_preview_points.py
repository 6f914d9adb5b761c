"""Surfels in a landscape: from where, how many, how large, and how they fade in."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from surfel_sets import ball
from walk_cases import FOCAL_PX, OPAQUE, Garden, crown, plants, species_of

from vegtool.formats.gltf import level_glb
from vegtool.gl.context import context, framebuffer_kept
from vegtool.gl.instances import WHOLE
from vegtool.gl.screen import Screen
from vegtool.lod import Level
from vegtool.preview.choice import Chosen, Seen
from vegtool.preview.eye import Eye
from vegtool.preview.forest import Forest
from vegtool.preview.fovea import Fovea
from vegtool.preview.palette import PALETTE
from vegtool.preview.scenery import Look
from vegtool.tiles.library import Species, StoredSurfels

pytestmark = pytest.mark.gl
SIZE = (256, 256)
FROM_M = 20.0
EYE = Eye(np.array([0.0, 1.0, 0.0]), fov_y_deg=60.0)
SURFELS = ball(2000, 1.0, (0, 1, 0), unlit=True)


@pytest.fixture(scope="module")
def species(tmp_path_factory: pytest.TempPathFactory) -> Species:
    file = tmp_path_factory.mktemp("surfels") / "ball.glb"
    file.write_bytes(level_glb(Level("surfels", surfels=SURFELS, unlit=True), "ball"))
    one = species_of("ball", crown(40, 0.2, OPAQUE))
    return replace(one, surfels=StoredSurfels(Path(file), FROM_M, 0.15))


@pytest.fixture(scope="module")
def forest(species: Species) -> Iterator[Forest]:
    away = (5.0, 11.0, 22.0, 60.0, 120.0)
    feet = [(0.0, 0.0, -metres) for metres in away]
    made = Forest([species], Garden([plants(feet)]), sharp=True)
    for _ in made.load(context()):
        pass
    yield made
    made.release()


def chosen_at(forest: Forest, look: Look | None = None) -> tuple[Seen, Chosen]:
    found, what, _ = forest.choose(EYE, SIZE, look or Look())
    return found, what


def focal() -> float:
    return EYE.focal_px(SIZE[1])


def test_plants_are_surfels_from_their_distance_on(forest: Forest) -> None:
    """It is stated for pictures of more pixels. Within the fade range a plant is both."""
    from_m = FROM_M * focal() / FOCAL_PX
    found, what = chosen_at(forest)
    away = found.distance[what.of]
    assert (what.points <= (away >= from_m)).all()
    whole = what.points & (away > 1.15 * from_m)
    assert np.allclose(what.kept[whole], WHOLE)
    both = [of for of in np.unique(what.of) if (what.of == of).sum() == 2]
    assert all(from_m <= found.distance[of] <= 1.15 * from_m for of in both)


def test_a_prefix_is_a_quarter_at_twice_the_distance(forest: Forest) -> None:
    """As its discs' radius is twice as large, in metres: from what is nearest of the ball."""
    found, what = chosen_at(forest)
    (batch,) = forest._frame(found, what, EYE, SIZE, Look()).points
    away = found.distance[what.of[what.points]] - 1.0
    pixel = away / focal()
    expected = SURFELS.spacing.prefixes(pixel / 2)
    assert batch.prefix[-2:] == pytest.approx(expected[-2:], rel=0.1)
    ratio = batch.prefix[-2] / batch.prefix[-1]
    assert ratio == pytest.approx((away[-1] / away[-2]) ** 2, rel=0.1)


def test_less_detail_brings_surfels_nearer(forest: Forest) -> None:
    """Discs of twice the pixels suffice at half the distance."""
    nearest = {}
    for detail in (1.0, 0.5):
        found, what = chosen_at(forest, Look(detail=detail))
        nearest[detail] = what.points.sum(), found.distance[what.of[what.points]].min()
    assert nearest[0.5][0] > nearest[1.0][0] and nearest[0.5][1] < nearest[1.0][1]


def test_levels_are_held_as_others_are(forest: Forest) -> None:
    for level, points in ((0, False), (1, True), (9, True)):
        _, what = chosen_at(forest, Look(level=level))
        assert (what.points == points).all()


def test_fading_surfels_are_fewer_not_smaller(forest: Forest) -> None:
    """And the share of the original's elements that is left is what they do not show."""
    from_m = FROM_M * focal() / FOCAL_PX
    eye = Eye(np.array([0.0, 1.0, 1.07 * from_m - 22.0]), fov_y_deg=60.0)
    found, what, _ = forest.choose(eye, SIZE, Look())
    pair = [of for of in np.unique(what.of) if (what.of == of).sum() == 2]
    assert len(pair) == 1
    (mine,) = np.flatnonzero((what.of == pair[0]) & what.points)
    (other,) = np.flatnonzero((what.of == pair[0]) & ~what.points)
    assert 0 < what.kept[mine] < WHOLE and 0 < what.kept[other] < WHOLE
    (batch,) = forest._frame(found, what, EYE, SIZE, Look()).points
    where = list(np.flatnonzero(what.points)).index(mine)
    all_of_them, radius = SURFELS.discs((found.distance[pair] - 1.0) / focal() / 2)
    assert batch.prefix[where] < all_of_them[0]
    unit = np.linalg.norm(np.ptp(SURFELS.position, axis=0)) / 2
    assert batch.rows["turn_size"][where, 2] * unit == pytest.approx(radius[0], rel=0.05)


def test_tints_are_the_plants_own_or_paint(forest: Forest) -> None:
    found, what = chosen_at(forest)
    for color, expected in (("as it is", found.rows["tint"][0]), ("by level", PALETTE[1])):
        look = Look(color=color)  # type: ignore[arg-type]
        (batch,) = forest._frame(found, what, EYE, SIZE, look).points
        assert (batch.rows["tint"] == expected).all()


def test_figures_tell_of_surfels(forest: Forest) -> None:
    ctx = context()
    with framebuffer_kept(ctx), Screen(ctx) as screen:
        screen.begin(SIZE, (0.0, 0.0, 0.0))
        stats = forest.draw(EYE, SIZE, Look())
        screen.resolve()
    assert stats.said[0].endswith(" surfels")


def test_surfels_of_twice_the_size_are_a_quarter_as_many(forest: Forest) -> None:
    """All over the picture, or where the fovea is not."""
    found, what = chosen_at(forest)
    fovea = Fovea((1e-9, 2e-9), (1.0, 2.0))
    aside = replace(EYE, yaw_deg=15.0)
    eyes = ((EYE, Look(surfel_px=2.0)), (aside, Look(fovea=fovea)))
    (one,) = forest._frame(found, what, EYE, SIZE, Look()).points
    for eye, look in eyes:
        (other,) = forest._frame(found, what, eye, SIZE, look).points
        assert one.prefix[-2:] / other.prefix[-2:] == pytest.approx([4.0, 4.0], rel=0.1)
    (same,) = forest._frame(found, what, EYE, SIZE, Look(fovea=fovea)).points
    assert (same.prefix == one.prefix).all(), "in the middle"
