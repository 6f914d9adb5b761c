"""Real plants, read as their makers meant them. Skipped where the folder of plants is absent."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from vegtool.formats import ReadOptions, read_plant
from vegtool.plant import Branches, Plant

pytestmark = pytest.mark.models

# file: triangles as its maker counts them, of those without area, materials and roles
EXPECTED = {
    "eztree_ash_small/eztree_ash_small.glb": (11072, 0, {"branches": "wood", "leaves": "leaf"}),
    "eztree_pine_medium/eztree_pine_medium.glb": (
        19872,
        8,
        {"branches": "wood", "leaves": "leaf"},
    ),
    "eztree_pine_medium/eztree_pine_medium.obj": (
        19872,
        8,
        {"branches": "wood", "leaves": "leaf"},
    ),
    "eztree_oak_small_nodes/eztree_oak_small_nodes.glb": (
        6806,
        0,
        {"branches": "wood", "leaves": "leaf"},
    ),
    "eztree_ash_zup_cm_obj/eztree_ash_zup_cm_obj.obj": (
        20000,
        0,
        {"branches": "wood", "leaves": "leaf"},
    ),
    "eztree_ash_notex_nouv/eztree_ash_notex_nouv.glb": (
        20000,
        0,
        {"branches": "wood", "leaves": "leaf"},
    ),
    "eztree_oak_heavy/eztree_oak_heavy.glb": (300480, 0, {"branches": "wood", "leaves": "leaf"}),
    "sapling_birch_lv2/sapling_birch_lv2.glb": (160584, 0, {"bark": "wood", "leaf": "leaf"}),
    "sapling_callistemon_bush/sapling_callistemon_bush.glb": (
        35588,
        0,
        {"bark": "wood", "leaf": "leaf"},
    ),
    "proctree_default/proctree_default.obj": (4916, 0, {"bark": "wood", "twig": "leaf"}),
    "arbaro_palm/arbaro_palm.obj": (
        53603,
        0,
        {"trunk": "wood", "stems_1": "wood", "leaves": "leaf"},
    ),
    "q_mega_commontree_1/gltf/CommonTree_1.gltf": (
        6265,
        0,
        {"Bark_NormalTree": "wood", "Leaves_NormalTree": "leaf"},
    ),
    "cesium_tree/tree.glb": (2076, 120, {"material_0": "wood", "material_1": "leaf"}),
    "kenney_tree_oak/tree_oak_conv.glb": (196, 2, {"leafsGreen": "leaf", "woodBark": "wood"}),
    "kenney_tree_oak/tree_oak_conv.obj": (196, 2, {"leafsGreen": "leaf", "woodBark": "wood"}),
    "airplane/airplane.ply": (2452, 0, {"default": "wood"}),
}


@cache
def model(folder: Path, name: str) -> Plant:
    return read_plant(folder / name)


@pytest.mark.parametrize("name", EXPECTED)
def test_triangles_and_roles(models: Path, name: str) -> None:
    plant = model(models, name)
    triangles, flat, roles = EXPECTED[name]
    assert len(plant.faces) == triangles - flat
    assert {m.name: m.role for m in plant.materials} == roles
    assert any(f"{flat} of {triangles} faces" in note for note in plant.notes) is bool(flat)
    assert 0.1 < plant.height < 10_000 and np.isfinite(plant.normals).all()
    assert np.allclose(np.linalg.norm(plant.normals, axis=1), 1)


@pytest.mark.parametrize("name", [n for n in EXPECTED if not n.endswith(".obj")])
def test_same_triangles_as_trimesh_reads(models: Path, name: str) -> None:
    """Another reader as oracle where it is known to be right: total area and bounds."""
    trimesh = pytest.importorskip("trimesh")
    with np.errstate(all="ignore"):
        scene = trimesh.load_scene(models / name, process=False)
        mesh = scene.to_geometry()
    plant = model(models, name)
    assert np.allclose(plant.bounds, mesh.bounds, atol=1e-5 * plant.radius)
    assert plant.face_areas.sum() == pytest.approx(mesh.area, rel=1e-5)


@pytest.mark.parametrize("name", [n for n in EXPECTED if n.endswith(".obj")])
def test_obj_area_against_its_plain_lines(models: Path, name: str) -> None:
    """An oracle in plain Python: split every polygon into a fan and sum up."""
    points, area = [], 0.0
    for line in (models / name).read_text().splitlines():
        kind, *words = line.split() or [""]
        if kind == "v":
            points.append(np.array(words[:3], dtype=float))
        elif kind == "f":
            a, *others = [points[int(word.split("/")[0]) - 1] for word in words]
            for b, c in pairwise(others):
                u, v = b - a, c - a
                cross = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                         u[0] * v[1] - u[1] * v[0])  # fmt: skip
                area += 0.5 * float(np.sqrt(sum(x * x for x in cross)))
    assert model(models, name).face_areas.sum() == pytest.approx(area, rel=1e-9)


def test_leaf_textures_are_masks_and_passed_on(models: Path) -> None:
    for name in EXPECTED:
        for material in model(models, name).materials:
            if material.color_texture is not None:
                assert material.color_texture.encoded is not None, name
                assert material.alpha_mode == ("mask" if material.role == "leaf" else "opaque")


def test_one_tree_in_two_formats(models: Path) -> None:
    """Pine as GLB and OBJ; ash as GLB in metres and as OBJ in centimetres, z up; kenney's oak."""
    folder, name = "eztree_pine_medium", "eztree_pine_medium"
    pine = [model(models, f"{folder}/{name}.{kind}") for kind in ("glb", "obj")]
    ash = [
        model(models, "eztree_ash_notex_nouv/eztree_ash_notex_nouv.glb"),
        read_plant(
            models / "eztree_ash_zup_cm_obj/eztree_ash_zup_cm_obj.obj", ReadOptions(unit="cm")
        ),
    ]
    oak = [model(models, f"kenney_tree_oak/tree_oak_conv.{kind}") for kind in ("glb", "obj")]
    for one, other in (pine, ash, oak):
        assert np.allclose(one.bounds, other.bounds, atol=1e-4 * one.radius)
        assert one.face_areas.sum() == pytest.approx(other.face_areas.sum(), rel=1e-3)
        colors = [[m.base_color for m in plant.materials] for plant in (one, other)]
        assert np.allclose(colors[0], colors[1], atol=1e-3)
    assert np.allclose(pine[0].corners, pine[1].corners, atol=1e-4)
    assert np.abs(pine[0].uvs[pine[0].faces] - pine[1].uvs[pine[1].faces]).max() < 1e-3


def true_branches(models: Path, name: str) -> Branches:
    folder = models / name
    stored = np.load(folder / f"{name}.face_branch.npz")
    faces = np.concatenate([stored["wood_face_branch"], stored["leaf_face_branch"]])
    return Branches(faces, stored["parent"], stored["level"], "generator")


def level_one(branches: Branches) -> np.ndarray:
    return np.asarray(branches.ancestor_at(1)[branches.face_branch])


def test_nested_nodes_are_the_true_branches(models: Path) -> None:
    """One node per branch: parents, levels and the number of wood and leaf faces of each branch.
    (The file's faces are ordered by node, the truth's by material.)"""
    plant = model(models, "eztree_oak_small_nodes/eztree_oak_small_nodes.glb")
    truth, found = true_branches(models, "eztree_oak_small_nodes"), plant.branches
    assert found is not None and found.source == "nodes"
    assert np.array_equal(found.parent, truth.parent) and np.array_equal(found.level, truth.level)
    wood = np.arange(len(truth.face_branch)) < (~plant.face_is_leaf).sum()
    for true_part, part in ((wood, ~plant.face_is_leaf), (~wood, plant.face_is_leaf)):
        assert np.array_equal(
            np.bincount(truth.face_branch[true_part], minlength=len(truth)),
            np.bincount(found.face_branch[part], minlength=len(truth)),
        )


@pytest.mark.parametrize(
    ("name", "kind", "least"),
    [
        ("eztree_ash_small", "glb", 1.0),
        ("eztree_ash_notex_nouv", "glb", 1.0),
        ("eztree_oak_heavy", "glb", 0.98),
        ("eztree_ash_zup_cm_obj", "obj", 0.999),
    ],
)
def test_declared_branches_are_true(models: Path, name: str, kind: str, least: float) -> None:
    """Attributes and groups name branches and levels; parents (and OBJ's leaves) come by nearness.
    Share of faces on the right branch of level 1."""
    plant = model(models, f"{name}/{name}.{kind}")
    truth, found = true_branches(models, name), plant.branches
    assert found is not None and np.array_equal(found.level, truth.level)
    assert np.array_equal(found.face_branch[~plant.face_is_leaf],
                          truth.face_branch[~plant.face_is_leaf])  # fmt: skip
    for part in (plant.face_is_leaf, ~plant.face_is_leaf):
        assert (level_one(found) == level_one(truth))[part].mean() >= least


def test_parts_per_level_are_no_branches(models: Path) -> None:
    for name in (
        "arbaro_palm/arbaro_palm.obj",
        "sapling_birch_lv2/sapling_birch_lv2.glb",
        "q_mega_commontree_1/gltf/CommonTree_1.gltf",
        "cesium_tree/tree.glb",
        "proctree_default/proctree_default.obj",
    ):
        assert model(models, name).branches is None


def test_materials_without_names_are_told_apart(models: Path) -> None:
    """By mask, colour and shape alone."""
    from dataclasses import replace

    from vegtool.formats.read import assemble
    from vegtool.formats.read_gltf import parse

    for name in EXPECTED:
        if not name.endswith(("glb", "gltf")):
            continue
        parsed = parse(models / name)
        nameless = replace(
            parsed,
            parts=[replace(part, name="") for part in parsed.parts],
            materials=[replace(material, name="") for material in parsed.materials],
            declared=None,
        )
        plant = assemble(nameless, models / name, ReadOptions())
        roles = [m.role for m in plant.materials]
        assert roles == [m.role for m in model(models, name).materials], name


def test_vertex_colors_of_a_stylised_tree_are_kept(models: Path) -> None:
    """Grey shading on its bark, white on its leaves."""
    colors = model(models, "q_mega_commontree_1/gltf/CommonTree_1.gltf").colors
    assert colors is not None and colors[:, :3].min() == pytest.approx(0.1005, abs=1e-3)


def test_dome_normals_are_kept(models: Path) -> None:
    """Many leaves of the stylised crown face against their normals, on purpose."""
    plant = model(models, "q_mega_commontree_1/gltf/CommonTree_1.gltf")
    facing = np.einsum("fj,fj->f", plant.face_area_vectors, plant.normals[plant.faces].sum(axis=1))
    assert (facing[plant.face_is_leaf] < 0).mean() > 0.1


def test_a_size_that_no_plant_has_is_questioned(models: Path) -> None:
    """The file counts in centimetres: 49 metres read as 4,900."""
    path = models / "eztree_ash_zup_cm_obj" / "eztree_ash_zup_cm_obj.obj"
    assert any("--unit" in note for note in read_plant(path).notes)
    assert not any("--unit" in note for note in read_plant(path, ReadOptions(unit="cm")).notes)
