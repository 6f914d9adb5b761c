"""The branches that a sample knows of, and the order of its triangles."""

from __future__ import annotations

import numpy as np
import pytest

from vegtool.growth import SAMPLES, sample
from vegtool.growth.hierarchy import number_branches

PLANTS = [name for name in SAMPLES if name not in ("statue", "height-field")]


def test_branches_are_numbered_depth_first() -> None:
    """Two trunks; the first has children a and b, b has two twigs, the second trunk one child."""
    parents = [np.array([-1, -1]), np.array([0, 0, 1]), np.array([1, 1])]
    drawn = [np.ones(2, bool), np.ones(3, bool), np.ones(2, bool)]
    numbers, parent, level = number_branches(parents, drawn)
    assert [list(n) for n in numbers] == [[0, 5], [1, 2, 6], [3, 4]]
    assert list(parent) == [-1, 0, 0, 2, 2, -1, 5]
    assert list(level) == [0, 1, 1, 2, 2, 0, 1]


def test_a_stem_that_is_not_drawn_belongs_to_its_nearest_drawn_ancestor() -> None:
    parents = [np.array([-1]), np.array([0, 0]), np.array([0, 1])]
    drawn = [np.array([True]), np.array([False, True]), np.array([False, True])]
    numbers, parent, _ = number_branches(parents, drawn)
    assert [list(n) for n in numbers] == [[0], [0, 1], [0, 2]]
    assert list(parent) == [-1, 0, 1]


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("triangles", [200, None])
def test_triangles_are_stored_depth_first(name: str, triangles: int | None) -> None:
    branches = sample(name, triangles).branches
    assert branches is not None and branches.source == "generator"
    assert (np.diff(branches.face_branch) >= 0).all()
    assert (branches.parent < np.arange(len(branches))).all()
    # Depth-first: the next branch grows from this one or from one of those it grows from.
    chain: list[int] = []
    for number, parent in enumerate(branches.parent):
        while chain and chain[-1] != parent:
            chain.pop()
        assert parent == (chain[-1] if chain else -1)
        chain.append(number)


@pytest.mark.parametrize("name", ["broadleaf", "conifer", "bush", "palm", "herb"])
def test_every_leaf_is_near_its_branch(name: str) -> None:
    """A leaf's nearest corner lies on the wood of its branch, or on a twig too fine to be drawn."""
    plant = sample(name, 60_000)  # enough for every twig to be drawn
    assert plant.branches is not None
    leaf = plant.face_is_leaf
    worst = 0.0
    for branch in np.unique(plant.branches.face_branch[leaf])[::97]:
        own = plant.branches.face_branch == branch
        wood = plant.positions[np.unique(plant.faces[own & ~leaf])]
        leaves = plant.corners[own & leaf].reshape(-1, 3)
        away = np.linalg.norm(leaves[:, None] - wood[None], axis=2).reshape(-1, 3, len(wood))
        worst = max(worst, float(away.min(axis=(1, 2)).max()))
    assert worst < 0.08 * plant.height


@pytest.mark.parametrize("name", ["broadleaf", "dead-tree"])
def test_every_branch_starts_on_its_parent(name: str) -> None:
    """Its lowest ring lies around the parent's axis, so within the parent's wood or at its skin."""
    plant = sample(name, 60_000)
    assert plant.branches is not None
    wood = ~plant.face_is_leaf
    face_branch = plant.branches.face_branch
    firsts = np.searchsorted(face_branch, np.arange(len(plant.branches)))
    for branch in range(1, len(plant.branches), 37):
        parent = plant.branches.parent[branch]
        start = plant.positions[plant.faces[firsts[branch], 0]]
        ring = plant.positions[plant.faces[wood & (face_branch == parent)]].reshape(-1, 3)
        size = np.ptp(ring, axis=0).max()
        assert np.linalg.norm(ring - start, axis=1).min() < 0.25 * size
