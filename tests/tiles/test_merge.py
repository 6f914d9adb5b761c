"""Plants merged into one mesh, against each plant's vertices turned one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from math import cos, pi, sin

import numpy as np
import numpy.typing as npt
import pytest

from vegtool.arrays import unit
from vegtool.lod import Triangles
from vegtool.seeding import generator
from vegtool.tiles.merge import merged
from vegtool.tiles.sheet import BRIGHTEST
from vegtool.tiles.stand import Stand

HERE = np.zeros(3)


def part(vertices: int, faces: int, seed: int = 0, colored: bool = True) -> Triangles:
    rng = generator(seed, "part")
    tangents = np.concatenate(
        [unit(rng.normal(size=(vertices, 3))), rng.choice([-1.0, 1], (vertices, 1))], axis=1
    )
    return Triangles(
        rng.normal(size=(vertices, 3)), unit(rng.normal(size=(vertices, 3))), tangents,
        rng.random((vertices, 2)), rng.integers(0, vertices, 3 * faces).astype(np.int32),
        rng.random((vertices, 4)) if colored else None,
    )  # fmt: skip


PARTS = part(5, 3, 1), part(4, 6, 2), part(7, 2, 3, colored=False)


def stand(count: int, seed: int = 0, away: npt.ArrayLike = (0, 0, 0)) -> Stand:
    rng = generator(seed, "stand")
    return Stand(
        rng.uniform(-20, 20, (count, 3)) + np.asarray(away, np.float64),
        np.zeros(count, np.int32), rng.uniform(0.5, 2.0, count), rng.uniform(0, 2 * pi, count),
        rng.uniform(0.85, 1.14, (count, 3)).astype(np.float32), np.arange(count),
        np.zeros(count, np.int64),
    )  # fmt: skip


def about_y(vector: npt.ArrayLike, yaw: float) -> np.ndarray:
    """As turned_about_y of gl/shaders/instance.vert: a quarter turn takes +z to +x, +x to -z."""
    x, y, z = np.asarray(vector).tolist()
    return np.array([cos(yaw) * x + sin(yaw) * z, y, cos(yaw) * z - sin(yaw) * x])


def by_hand(
    plants: Stand, which: npt.ArrayLike, parts: Sequence[Triangles], origin: np.ndarray
) -> Triangles:
    """Part by part, plant by plant, vertex by vertex."""
    rows: dict[str, list[np.ndarray]] = {f.name: [] for f in fields(Triangles)}
    for number, one in enumerate(parts):
        for k in np.flatnonzero(np.asarray(which) == number):
            start, yaw = len(rows["positions"]), float(plants.yaw[k])
            for v in range(len(one.positions)):
                foot = plants.foot[k] - origin
                rows["positions"].append(plants.scale[k] * about_y(one.positions[v], yaw) + foot)
                rows["normals"].append(about_y(one.normals[v], yaw))
                rows["tangents"].append(
                    np.array([*about_y(one.tangents[v, :3], yaw), one.tangents[v, 3]])
                )
                rows["uvs"].append(one.uvs[v])
                own = np.ones(4) if one.colors is None else one.colors[v]
                tint = [float(t) / BRIGHTEST for t in plants.tint[k]]
                rows["colors"].append(own * [*tint, 1.0])
            rows["indices"] += [np.asarray(start + i) for i in one.indices]
    return Triangles(**{name: np.array(values) for name, values in rows.items()})


def test_a_group_is_its_plants_one_by_one() -> None:
    plants = stand(9)
    which = np.array([2, 0, 1, 0, 0, 2, 1, 2, 0], np.int32)
    for origin in (HERE, np.array([3.0, -2.0, 11.0])):
        found, wanted = merged(plants, which, PARTS, origin), by_hand(plants, which, PARTS, origin)
        for name in ("positions", "normals", "tangents", "uvs", "colors"):
            np.testing.assert_allclose(
                getattr(found, name),
                getattr(wanted, name),
                atol=1e-6 if name == "colors" else 1e-12,
            )
        assert found.indices.dtype == np.int32
        np.testing.assert_array_equal(found.indices, wanted.indices)


def test_a_plant_that_is_not_turned_is_its_part() -> None:
    plants = replace(stand(1), foot=np.zeros((1, 3)), scale=np.ones(1), yaw=np.zeros(1))
    found = merged(plants, np.zeros(1, np.int32), PARTS, HERE)
    for name in ("positions", "normals", "tangents", "uvs", "indices"):
        np.testing.assert_array_equal(getattr(found, name), getattr(PARTS[0], name))


def test_a_quarter_turn_takes_z_to_x() -> None:
    """Counter-clockwise from above, as instance.vert and a glTF rotation about +y have it."""
    arrow = replace(
        part(3, 1), positions=np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
        normals=np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    )  # fmt: skip
    plants = replace(
        stand(1), foot=np.array([[10.0, 0, 0]]), scale=np.array([2.0]), yaw=np.array([pi / 2])
    )
    found = merged(plants, np.zeros(1, np.int32), [arrow], HERE)
    np.testing.assert_allclose(found.positions, [[12, 0, 0], [10, 0, -2], [10, 2, 0]], atol=1e-12)
    np.testing.assert_allclose(found.normals, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-12)


def test_what_is_drawn_has_no_parts_that_no_plant_is() -> None:
    """And each plant has as many triangles as its part."""
    which = np.array([1, 1, 1], np.int32)
    found = merged(stand(3), which, PARTS, HERE)
    assert len(found.indices) == 3 * 3 * 6 and len(found.positions) == 3 * 4
    assert found.indices.max() < 12 and found.indices.min() >= 0


def test_tints_are_dark_enough_to_be_vertex_colors() -> None:
    """A tint of 1 is divided by BRIGHTEST, the sheet's gain; alpha is none of its business."""
    plants = replace(stand(1), tint=np.array([[1.0, BRIGHTEST, 0.5]], np.float32))
    found = merged(plants, np.zeros(1, np.int32), [replace(PARTS[2], colors=np.ones((7, 4)))], HERE)
    assert found.colors is not None
    np.testing.assert_allclose(
        found.colors, np.tile([1 / BRIGHTEST, 1.0, 0.5 / BRIGHTEST, 1.0], (7, 1)), rtol=1e-6
    )


def test_moved_plants_make_a_moved_group_and_moved_with_their_origin_the_same() -> None:
    which = np.array([0, 1, 2, 1], np.int32)
    here, there = stand(4), stand(4, away=(64.0, 8, -32))
    base = merged(here, which, PARTS, HERE)
    moved = merged(there, which, PARTS, HERE)
    np.testing.assert_allclose(
        moved.positions, base.positions + np.array([64.0, 8, -32]), atol=1e-12
    )
    again = merged(there, which, PARTS, np.array([64.0, 8, -32]))
    np.testing.assert_allclose(again.positions, base.positions, atol=1e-12)
    for name in ("normals", "tangents", "uvs", "indices", "colors"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(base, name))


def test_a_stand_turned_as_a_whole_is_a_turned_group() -> None:
    which, angle = np.array([0, 1, 0], np.int32), 0.7
    plants = stand(3)
    feet = np.array([about_y(foot, angle) for foot in plants.foot])
    base = merged(plants, which, PARTS, HERE)
    found = merged(replace(plants, foot=feet, yaw=plants.yaw + angle), which, PARTS, HERE)
    for name in ("positions", "normals"):
        wanted = [about_y(row, angle) for row in getattr(base, name)]
        np.testing.assert_allclose(getattr(found, name), wanted, atol=1e-12)


def test_plants_far_from_the_origin_keep_their_shape() -> None:
    """Of the scene, near the tile's: to a millionth of a millimetre."""
    which, away = np.array([0, 1, 2], np.int32), np.array([5e6, 100.0, -5e6])
    near, far = merged(stand(3), which, PARTS, HERE), merged(stand(3, 0, away), which, PARTS, away)
    np.testing.assert_allclose(far.positions, near.positions, atol=1e-8)


def test_merging_changes_nothing_and_is_the_same_again() -> None:
    def held(one: Triangles) -> bytes:
        return b"".join(
            getattr(one, f.name).tobytes() for f in fields(one) if getattr(one, f.name) is not None
        )

    plants, which = stand(6), np.array([0, 1, 2, 2, 1, 0], np.int32)
    names = ("foot", "species", "scale", "yaw", "tint", "row")
    before = [held(one) for one in PARTS], [getattr(plants, n).tobytes() for n in names]
    one, two = (merged(plants, which, PARTS, HERE) for _ in range(2))
    assert held(one) == held(two)
    assert ([held(p) for p in PARTS], [getattr(plants, n).tobytes() for n in names]) == before


def test_a_level_that_is_not_on_the_sheet_is_told() -> None:
    for part in ([0, -1], [0, len(PARTS)]):
        with pytest.raises(ValueError, match="a part for each"):
            merged(stand(2), np.array(part, np.int32), PARTS, HERE)
    with pytest.raises(ValueError, match="expected plants"):
        merged(stand(0), np.zeros(0, np.int32), PARTS, HERE)
