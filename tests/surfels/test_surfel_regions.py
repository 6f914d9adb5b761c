"""Where triangles of all levels lie on the coarsest one."""

from __future__ import annotations

import numpy as np
from surfel_cases import COARSE, ball, both, hills, surface

from vegtool.meshes.distance import to_triangles
from vegtool.surfels.cuts import coarsest, triangles
from vegtool.surfels.multi_triangulation import MultiTriangulation, multi_triangulation
from vegtool.surfels.regions import beneath


def patches_of(mt: MultiTriangulation) -> tuple[np.ndarray, np.ndarray]:
    """Rows of the coarsest triangles, and the patch of each."""
    cut = coarsest(mt)
    return triangles(mt, cut), np.repeat(np.arange(cut.sum()), mt.sizes[cut])


def asked(mt: MultiTriangulation) -> np.ndarray:
    """(t, 4, 3) corners and middles."""
    corners = mt.plant.positions[mt.faces]
    return np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)


def test_coarsest_triangles_lie_on_their_own_patches() -> None:
    mt = multi_triangulation(hills(), COARSE)
    rows, patch = patches_of(mt)
    found = beneath(mt)
    assert np.array_equal(found[rows], np.repeat(patch[:, None], 4, axis=1))
    assert found.min() == 0 and found.max() == patch.max()


def test_what_is_beneath_is_as_near_as_errors_say() -> None:
    """Each node of the way moves the surface by no more than the coarsest triangles' error, and a
    way is no longer than there are rounds; on a plane, where nothing moves, points are on what is
    beneath them."""
    for height in (0.0, 0.05):
        mt = multi_triangulation(hills(30, height), COARSE)
        rows, patch = patches_of(mt)
        assert len(rows) < len(mt.plant.faces) / 2
        points, found = asked(mt), beneath(mt)
        corners = mt.plant.positions[mt.faces[rows]]
        limit = 4 * mt.error[:-1].max() + 1e-9
        for number in np.unique(patch):
            here = points[found == number]
            away = [to_triangles(here, np.broadcast_to(one, (len(here), 3, 3)))
                    for one in corners[patch == number]]  # fmt: skip
            assert np.min(away, axis=0).max(initial=0) <= limit


def test_another_sheet_is_never_beneath() -> None:
    """Two balls, one around the other, nearer than what triangles are moved by."""
    inner, outer = ball(4, 0.0), ball(4, 0.0)
    outer = surface(1.05 * outer.positions, outer.faces, normals=outer.normals)
    mt = multi_triangulation(both(inner, outer), COARSE)
    assert mt.error[:-1].max() > 0.05
    rows, patch = patches_of(mt)
    is_outer = mt.faces[:, 0] >= len(inner.positions)
    of_patch = np.zeros(patch.max() + 1, bool)
    of_patch[patch] = is_outer[rows]
    assert np.array_equal(of_patch[beneath(mt)], np.repeat(is_outer[:, None], 4, axis=1))
