"""How much of a plant recover_branches puts on the right level-1 branch, with the hierarchy hidden.

    python benchmarks/branches.py [--models FOLDER] [--samples] [--row]

Each face's true label is its branch's ancestor at level 1, or the trunk itself where it is on a
trunk; the found labels likewise. Found and true labels are matched one to one so that as many faces
as possible agree (Hungarian method); what a found label holds of any other true label is wrong, and
so is all of a label that has no match. `wood` and `leaf` are shares of faces.

Variants: indexed (as in the file), shuffled (faces in random order), soup (every face has three
vertices of its own), soup shuffled. Targets on the ez-tree models: indexed 99 / 98 % (oak_heavy
97 / 90 %), soup 90 / 85 %. `seconds` is processor time, the median of three.

FOLDER holds NAME/NAME.glb or .obj with NAME.face_branch.npz (ez-tree models), or with one node per
branch; its default is VEGTOOL_MODELS, or ../shared/models. `--samples` adds vegtool's own sample
plants, whose generator knows their branches. `--row` appends to benchmarks/results/branches.csv.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from recorded import record

import vegtool
from vegtool.branches import recover_branches
from vegtool.formats import read_plant
from vegtool.growth import SAMPLES, sample
from vegtool.plant import Branches, Plant
from vegtool.seeding import generator

MODELS = (
    "eztree_ash_small",
    "eztree_pine_medium",
    "eztree_ash_notex_nouv",
    "eztree_oak_heavy",
    "eztree_ash_zup_cm_obj",
    "eztree_oak_small_nodes",
)


@dataclass(frozen=True, eq=False)
class Case:
    """A plant without branches, and the truth."""

    plant: Plant
    truth: Branches


def models_folder() -> Path:
    """VEGTOOL_MODELS, or ../shared/models beside the checkout."""
    beside = Path(__file__).parent.parent.parent / "shared" / "models"
    return Path(os.environ.get("VEGTOOL_MODELS", beside))


def eztree_case(folder: Path, name: str) -> Case:
    """A model with its face_branch.npz: the truth of wood faces, then of leaf faces, in order."""
    path = next(p for p in (folder / name / f"{name}{e}" for e in (".glb", ".obj")) if p.exists())
    plant = read_plant(path)
    if plant.branches is not None and plant.branches.source == "nodes":
        return Case(replace(plant, branches=None), plant.branches)  # one node per branch: the truth
    plant = replace(plant, branches=None)
    with np.load(folder / name / f"{name}.face_branch.npz") as table:
        wood, leaf = table["wood_face_branch"], table["leaf_face_branch"]
        parent, level = table["parent"], table["level"]
    is_leaf = plant.face_is_leaf
    if (~is_leaf).sum() == len(wood) and is_leaf.sum() == len(leaf):
        face_branch = np.empty(len(is_leaf), dtype=np.int32)
        face_branch[~is_leaf], face_branch[is_leaf] = wood, leaf
    else:
        face_branch = by_corners(plant, path, np.concatenate([wood, leaf]))
    return Case(plant, Branches(face_branch, parent, level, "generator"))


def by_corners(plant: Plant, path: Path, labels: np.ndarray) -> np.ndarray:
    """The labels of all faces in the file, for those that the reader kept; found by corners."""
    import trimesh
    from scipy.spatial import cKDTree

    scene = trimesh.load(path, process=False, force="scene")
    corners = np.concatenate([g.vertices[g.faces] for g in scene.geometry.values()])
    away, row = cKDTree(corners.reshape(-1, 9)).query(plant.corners.reshape(-1, 9))
    if len(corners) != len(labels) or away.max() > 1e-6 * plant.radius:
        raise ValueError(f"{path}: the faces read are not those of the table of branches")
    return np.asarray(labels[row], dtype=np.int32)


def sample_case(name: str) -> Case:
    """A sample plant, and what its generator says."""
    plant = sample(name)
    assert plant.branches is not None
    return Case(replace(plant, branches=None), plant.branches)


def reordered(case: Case, order: np.ndarray) -> Case:
    """The same with the faces in another order."""
    plant = replace(
        case.plant, faces=case.plant.faces[order], face_material=case.plant.face_material[order]
    )
    return Case(plant, replace(case.truth, face_branch=case.truth.face_branch[order]))


def shuffled(case: Case) -> Case:
    """Faces in random order."""
    return reordered(case, generator(0, "shuffle").permutation(len(case.plant.faces)))


def soup(case: Case) -> Case:
    """Three vertices for every face."""
    plant, corner = case.plant, case.plant.faces.ravel()
    unindexed = replace(
        plant,
        positions=plant.positions[corner],
        normals=plant.normals[corner],
        uvs=plant.uvs[corner],
        colors=None if plant.colors is None else plant.colors[corner],
        faces=np.arange(len(corner), dtype=np.int32).reshape(-1, 3),
    )
    return Case(unindexed, case.truth)


VARIANTS: dict[str, Callable[[Case], Case]] = {
    "indexed": lambda case: case,
    "shuffled": shuffled,
    "soup": soup,
    "soup shuffled": lambda case: soup(shuffled(case)),
}


def level_one(branches: Branches) -> np.ndarray:
    """(f,) dense labels: the branch at level 1 that each face belongs to, or its trunk."""
    label = branches.ancestor_at(1)[branches.face_branch]
    return np.asarray(np.unique(label, return_inverse=True)[1])


def right_faces(found: Branches, truth: Branches) -> np.ndarray:
    """(f,) bool: faces whose level-1 label agrees under the best one-to-one matching."""
    from scipy.optimize import linear_sum_assignment

    a, b = level_one(found), level_one(truth)
    overlap = np.zeros((a.max() + 1, b.max() + 1))
    np.add.at(overlap, (a, b), 1)
    row, column = linear_sum_assignment(overlap, maximize=True)
    match = np.full(len(overlap), -1)
    match[row] = column
    return np.asarray(match[a] == b)


def measure(case: Case, repeats: int = 3) -> dict[str, object]:
    """The columns of the table, for one case."""
    case.plant.bounds  # noqa: B018 (cached: part of reading, not of recovering)
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        found = recover_branches(case.plant)
        seconds.append(time.process_time() - start)
    right, leaf = right_faces(found, case.truth), case.plant.face_is_leaf
    return {
        "faces": len(leaf),
        "wood": share(right[~leaf]),
        "leaf": share(right[leaf]),
        "found": level_one(found).max() + 1,
        "true": level_one(case.truth).max() + 1,
        "levels": " ".join(map(str, np.bincount(found.level))),
        "seconds": f"{statistics.median(seconds):.2f}",
    }


def share(right: np.ndarray) -> str:
    """A percentage, or a dash where there is nothing to count."""
    return f"{100 * right.mean():.2f}" if len(right) else "-"


def rows(models: Path, samples: bool) -> Iterator[dict[str, object]]:
    """One row per plant and variant."""
    cases = [(name, lambda n=name: eztree_case(models, n)) for name in MODELS]
    if not models.is_dir():
        print(f"{models}: not there; no ez-tree models")
        cases = []
    if samples:
        solids = ("statue", "height-field")
        cases += [(name, lambda n=name: sample_case(n)) for name in SAMPLES if name not in solids]
    for name, make in cases:
        case = make()
        for variant, change in VARIANTS.items():
            row = measure(change(case))
            yield {"version": vegtool.__version__, "plant": name, "variant": variant, **row}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--models", type=Path, default=models_folder())
    parser.add_argument("--samples", action="store_true")
    parser.add_argument("--row", action="store_true")
    args = parser.parse_args()
    written = []
    for row in rows(args.models, args.samples):
        if not written:
            print("  ".join(f"{name:>13}" for name in row))
        print("  ".join(f"{value!s:>13}" for value in row.values()), flush=True)
        written.append(row)
    if args.row and written:
        record("branches", written)


if __name__ == "__main__":
    main()
