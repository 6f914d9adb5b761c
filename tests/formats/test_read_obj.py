"""OBJ, MTL, PLY and STL, each quirk by the smallest file that shows it."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from made import leaf_pixels, png, tube, tube_faces

from vegtool.formats import ReadOptions, read_plant
from vegtool.formats.polygons import triangulate
from vegtool.plant import Plant

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 1\n"


def obj(folder: Path, text: str, mtl: str = "", **options: str) -> Plant:
    (folder / "plant.obj").write_text(text)
    if mtl:
        (folder / "plant.mtl").write_text(mtl)
    return read_plant(folder / "plant.obj", ReadOptions(**options))


def card(folder: Path, mtl: str) -> Plant:
    """The square wearing the material `leaf` of that MTL text."""
    return obj(
        folder,
        "mtllib plant.mtl\n" + SQUARE + "usemtl leaf\nf 1/1/1 2/2/1 3/3/1 4/4/1\n",
        "newmtl leaf\n" + mtl,
    )


@pytest.mark.parametrize(
    "faces",
    [
        "f 1/1/1 2/2/1 3/3/1\nf 1/1/1 3/3/1 4/4/1\n",
        "f 1/1/1 2/2/1 3/3/1 4/4/1\n",
        "f -4/-4/-1 -3/-3/-1 -2/-2/-1 -1/-1/-1\n",
        "f 1/1 2/2 3/3 4/4\n",
        "f 1/1/1 2/2/1 3/3/1\nf 1/1 3/3 4/4\n",
        "f 1/1/1 2/2 3/3/1\nf 1/1 3/3/1 4/4\n",
        "\tf 1/1/1\t2/2/1 3/3/1 \\\n 4/4/1   \n",
    ],
)
def test_faces_in_every_writing(tmp_path: Path, faces: str) -> None:
    """v points up in OBJ and down in a Plant."""
    plant = obj(tmp_path, SQUARE + faces)
    assert np.allclose(plant.face_area_vectors.sum(axis=0), [0, 0, 1])
    assert np.allclose(plant.normals, [0, 0, 1])
    expected = np.stack([plant.positions[:, 0], 1 - plant.positions[:, 1]], axis=1)
    assert np.array_equal(plant.uvs, expected)


@pytest.mark.parametrize("faces", ["f 1 2 3 4\n", "f 1//1 2//1 3//1 4//1\n"])
def test_faces_without_texture_coordinates(tmp_path: Path, faces: str) -> None:
    plant = obj(tmp_path, SQUARE + faces)
    assert len(plant.positions) == 4 and np.allclose(plant.normals, [0, 0, 1])


def test_windows_line_ends_and_relative_indices_between_blocks(tmp_path: Path) -> None:
    block = "v 0 0 {0}\nv 1 0 {0}\nv 0 1 {0}\nf -3 -2 -1\n"
    plant = obj(tmp_path, (block.format(1) + block.format(2)).replace("\n", "\r\n"))
    assert plant.face_centroids[:, 2].tolist() == [1, 2]


def test_face_order_is_that_of_the_file(tmp_path: Path) -> None:
    """Triangles and quads are read in bulk by shape, and put back in order."""
    second = SQUARE.replace("v 0 0 0", "v 0 0 5").replace("v 1 0 0", "v 1 0 5")
    text = SQUARE + second + "f 1 2 3\nf 5 6 7 8\nf 3//1 4//1 1//1\n"
    plant = obj(tmp_path, text)
    assert plant.faces.shape == (4, 3)
    corners = [[0, 1, 2], [4, 5, 6], [4, 6, 7], [2, 3, 0]]
    points = np.array([line.split()[1:] for line in text.splitlines() if line.startswith("v ")])
    assert np.array_equal(plant.corners, points.astype(float)[corners])


def test_texture_indices_that_do_not_exist_are_ignored(tmp_path: Path) -> None:
    plant = obj(tmp_path, SQUARE + "f 1/9/9 2/2/1 3/3/1\n")
    assert len(plant.faces) == 1 and np.allclose(plant.normals, [0, 0, 1])
    assert sum("does not have" in note for note in plant.notes) == 2


def test_smooth_across_texture_seams(tmp_path: Path) -> None:
    """A roof of two slopes whose ridge has two texture coordinates has one normal there."""
    text = "v -1 0 0\nv 0 1 0\nv 0 1 1\nv 1 0 0\nvt 0 0\nvt 1 1\nf 1/1 3/1 2/1\nf 2/2 3/2 4/2\n"
    plant = obj(tmp_path, text)
    ridge = plant.positions[:, 1] == 1
    assert ridge.sum() == 4 and np.allclose(plant.normals[ridge], [0, 1, 0])
    assert len(plant.positions) == 6


def test_vertex_colors_and_what_c_libraries_print_for_nan(tmp_path: Path) -> None:
    text = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0.5 0 0\nv -1.#IND 1 0 0 0 0\nf 1 2 3\nf 1 2 4\n"
    plant = obj(tmp_path, text)
    assert len(plant.faces) == 1 and any("NaN" in note for note in plant.notes)
    assert plant.colors is not None
    assert np.allclose(sorted(plant.colors[:, 0]), [0.2140, 1, 1], atol=1e-4)  # sRGB to linear


def test_alpha_in_the_colour_map_alone(tmp_path: Path) -> None:
    (tmp_path / "leaf.png").write_bytes(png(leaf_pixels(), palette=True))
    for mtl in ("map_Kd leaf.png\n", "map_Kd leaf.png\nmap_d -imfchan m leaf.png\n"):
        material = card(tmp_path, mtl).materials[0]
        assert material.alpha_mode == "mask" and material.color_texture is not None
        assert material.color_texture.encoded is not None and material.double_sided


@pytest.mark.parametrize("channels", [3, 4])
def test_alpha_in_a_map_of_its_own(tmp_path: Path, channels: int) -> None:
    """map_d is brightness where it has no alpha; of another size it is resized."""
    color = np.full((8, 8, 3), (40, 160, 30), np.uint8)
    mask = np.zeros((4, 4, channels), np.uint8)
    mask[:, 2:] = 255
    (tmp_path / "color.png").write_bytes(png(color))
    (tmp_path / "mask.png").write_bytes(png(mask))
    material = card(tmp_path, "map_Kd color.png\nmap_d mask.png\n").materials[0]
    assert material.alpha_mode == "mask" and material.color_texture is not None
    pixels = material.color_texture.pixels
    assert (pixels[:, :4, 3] == 0).all() and (pixels[:, 4:, 3] == 255).all()
    assert (pixels[..., :3] == color).all() and material.color_texture.encoded is None
    alone = card(tmp_path, "Kd 0 1 0\nmap_d mask.png\n").materials[0]
    assert alone.alpha_mode == "mask" and np.allclose(alone.base_color, [0, 1, 0, 1])


def test_black_kd_with_a_texture_is_white(tmp_path: Path) -> None:
    (tmp_path / "leaf.png").write_bytes(png(leaf_pixels()))
    plant = card(tmp_path, "Kd 0 0 0\nmap_Kd leaf.png\n")
    assert np.array_equal(plant.materials[0].base_color, np.ones(4))
    assert any("Kd 0 0 0" in note for note in plant.notes)
    assert np.array_equal(card(tmp_path, "Kd 0 0 0\n").materials[0].base_color, [0, 0, 0, 1])


def test_kd_is_srgb_but_linear_from_blender(tmp_path: Path) -> None:
    """Of one ez-tree export as OBJ (0.8078) and GLB (0.6172) the latter is the decoded former."""
    assert card(tmp_path, "Kd 0.8078 0 0\n").materials[0].base_color[0] == pytest.approx(
        0.6172, abs=1e-4
    )
    (tmp_path / "plant.mtl").write_text("# Blender 4.2 MTL File\nnewmtl leaf\nKd 0.5 0.5 0.5\n")
    plant = read_plant(tmp_path / "plant.obj")
    assert plant.materials[0].base_color[0] == 0.5


def test_opacity(tmp_path: Path) -> None:
    for mtl in ("d 0.4\n", "Tr 0.6\n"):
        plant = card(tmp_path, mtl)
        assert plant.materials[0].alpha_mode == "opaque" and any("opaque" in n for n in plant.notes)
    assert any("opacity 0" in note for note in card(tmp_path, "d 0\n").notes)
    assert card(tmp_path, "d 1\nTr 1\n").notes[:1] == card(tmp_path, "").notes[:1]


def test_normal_map_and_heights(tmp_path: Path) -> None:
    flat = np.full((8, 8, 3), (128, 128, 255), np.uint8)
    (tmp_path / "bumps normal.png").write_bytes(png(flat))
    (tmp_path / "height.png").write_bytes(png(np.full((8, 8, 3), 128, np.uint8)))
    material = card(tmp_path, "map_Bump -bm 0.5 bumps normal.png\n").materials[0]
    assert material.normal_texture is not None and material.normal_scale == 0.5
    assert card(tmp_path, "norm bumps normal.png\n").materials[0].normal_texture is not None
    plant = card(tmp_path, "map_Bump -bm 1 height.png\n")
    assert plant.materials[0].normal_texture is None and any("heights" in n for n in plant.notes)


def test_map_scale_and_offset_move_the_texture(tmp_path: Path) -> None:
    (tmp_path / "leaf.png").write_bytes(png(leaf_pixels()))
    plant = card(tmp_path, "map_Kd -s 2 3 1 -o 0.5 0 leaf.png\n")
    x, y = plant.positions[:, 0], plant.positions[:, 1]
    assert np.allclose(plant.uvs, np.stack([2 * x + 0.5, 1 - 3 * y], axis=1))


@pytest.mark.parametrize(
    "path", ["C:/art/leaf.png", "C:\\art\\leaf.png", "tex\\leaf.png", "LEAF.PNG"]
)
def test_paths_of_the_artists_machine(tmp_path: Path, path: str) -> None:
    (tmp_path / "leaf.png").write_bytes(png(leaf_pixels()))
    assert card(tmp_path, f"map_Kd {path}\n").materials[0].color_texture is not None


def test_missing_library_texture_and_material(tmp_path: Path) -> None:
    plant = obj(tmp_path, "mtllib gone.mtl\n" + SQUARE + "usemtl Frond\nf 1 2 3 4\n")
    assert plant.materials[0].name == "Frond" and plant.materials[0].role == "leaf"
    assert any("gone.mtl" in n for n in plant.notes) and any("Frond" in n for n in plant.notes)
    missing = card(tmp_path, "map_Kd gone.png\nmap_d gone2.png\n")
    assert {n.split()[1] for n in missing.notes if "missing" in n} == {"gone.png", "gone2.png"}


def test_names_with_spaces_and_two_libraries(tmp_path: Path) -> None:
    (tmp_path / "my leaves.mtl").write_text("newmtl big leaf\nKd 1 0 0\n")
    (tmp_path / "b.mtl").write_text("newmtl bark\nKd 0 0 1\n")
    text = "mtllib my leaves.mtl\nmtllib b.mtl\n" + SQUARE
    plant = obj(tmp_path, text + "usemtl big leaf\nf 1 2 3\nusemtl bark\nf 1 3 4\n")
    assert [(m.name, m.role) for m in plant.materials] == [("big leaf", "leaf"), ("bark", "wood")]
    assert plant.materials[0].base_color[0] == 1 and plant.materials[1].base_color[2] == 1


def tree_text(names: list[str]) -> str:
    """A trunk, two branches, a twig on the second: one group each, then a card near the twig."""
    spans = [([0, 0, 0], [0, 9, 0], 0.5), ([0, 4, 0], [4, 6, 0], 0.2)]
    spans += [([0, 6, 0], [-4, 8, 0], 0.2), ([-2, 7, 0], [-2, 9, 1], 0.1)]
    lines = []
    for k, (start, end, radius) in enumerate(spans):
        points = tube(np.array(start, float), np.array(end, float), radius)
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points]
        lines += [f"g {names[k]}", "usemtl bark"]
        lines += ["f {} {} {}".format(*row) for row in tube_faces().reshape(-1, 3) + 12 * k + 1]
    lines += ["v -2 9 1", "v -2 10 1", "v -3 10 1", "v -3 9 1"]
    return "\n".join([*lines, "g leaves", "usemtl leaf", "f 49 50 51 52\n"])


@pytest.mark.parametrize(
    "names",
    [
        ["branch_L0_0", "branch_L1_1", "branch_L1_2", "branch_L2_3"],
        ["Level 1 0", "Level 2 1", "Level 2 2", "Level 3 3"],
        ["stem", "stem.0", "stem.1", "stem.1.0"],
    ],
)
def test_groups_named_one_per_branch(tmp_path: Path, names: list[str]) -> None:
    plant = obj(tmp_path, tree_text(names))
    branches = plant.branches
    assert branches is not None and branches.source == "groups"
    assert branches.parent.tolist() == [-1, 0, 0, 2] and branches.level.tolist() == [0, 1, 1, 2]
    assert np.bincount(branches.face_branch).tolist() == [12, 12, 12, 12 + 2]
    assert any("2 faces of no declared branch" in note for note in plant.notes)


def test_groups_per_level_are_no_branches(tmp_path: Path) -> None:
    plant = obj(tmp_path, tree_text(["trunk", "stems_1", "stems_1", "stems_2"]))
    assert plant.branches is None


def test_up_is_guessed_from_where_the_plant_stands(tmp_path: Path) -> None:
    text = tree_text(["a", "b", "c", "d"])
    standing = obj(tmp_path, text)
    assert any("to be y" in note for note in standing.notes)
    rows = [line.split() for line in text.splitlines()]
    lying = "\n".join(
        f"v {r[1]} {-float(r[3])} {r[2]}" if r[0] == "v" else " ".join(r) for r in rows
    )
    turned = obj(tmp_path, lying + "\n")
    assert any("to be z" in note for note in turned.notes)
    assert np.allclose(turned.positions, standing.positions)
    assert np.allclose(obj(tmp_path, text, up="z").bounds[1, 2], -standing.bounds[0, 1])


def test_convex_polygons_become_fans() -> None:
    points = np.array([[np.cos(t), np.sin(t), 0] for t in np.linspace(0, 5, 6)])
    places = triangulate(np.arange(6)[None], points)
    assert places.tolist() == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]


@pytest.mark.parametrize("axes", [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
@pytest.mark.parametrize("turn", [1, -1])
def test_concave_polygons_keep_their_area(axes: tuple[int, int, int], turn: int) -> None:
    """Triangles of a simple polygon, all turning its way, add up to its area: none leaves it.
    Areas: the arrow by its two halves 2 x 1/2, the star by its shoelace sum."""
    arrow = np.array([[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0.0]])
    angles = np.arange(10) * np.pi / 5
    star = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    star[1::2] *= 0.4
    for ring in (arrow, star):
        points = ring[::turn][:, axes]
        x, y = ring[:, 0], ring[:, 1]
        area = 0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
        for start in range(len(points)):
            rolled = np.roll(points, start, axis=0)
            triangles = rolled[triangulate(np.arange(len(rolled))[None], rolled)]
            sides = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
            assert 0.5 * np.linalg.norm(sides, axis=1).sum() == pytest.approx(area)
            assert np.linalg.norm(sides.sum(axis=0)) == pytest.approx(2 * area)


PLY = (
    "ply\nformat ascii 1.0\n{comment}element vertex 4\nproperty float x\nproperty float y\n"
    "property float z\n{more}element face 1\nproperty list uchar int vertex_indices\n"
    "end_header\n{rows}4 0 1 2 3\n"
)
CORNERS = ["0 0 0", "1 0 0", "1 1 0", "0 1 0"]


def ply(folder: Path, comment: str = "", more: str = "", values: str = "") -> Plant:
    rows = "".join(f"{corner} {values}\n" for corner in CORNERS)
    (folder / "plant.ply").write_text(PLY.format(comment=comment, more=more, rows=rows))
    return read_plant(folder / "plant.ply")


def test_ply(tmp_path: Path) -> None:
    plant = ply(tmp_path)
    assert len(plant.faces) == 2 and np.allclose(plant.normals, [0, 0, 1])
    more = "".join(f"property uchar {c}\n" for c in ("red", "green", "blue"))
    green = ply(tmp_path, more=more, values="0 188 0")
    assert green.colors is not None and np.allclose(green.colors[0, 1], 0.503, atol=1e-3)


def test_ply_texture(tmp_path: Path) -> None:
    (tmp_path / "leaf.png").write_bytes(png(leaf_pixels()))
    more = "property float s\nproperty float t\n"
    plant = ply(tmp_path, "comment TextureFile leaf.png\n", more, "0.25 0.25")
    assert plant.materials[0].alpha_mode == "mask" and np.allclose(plant.uvs, [0.25, 0.75])


@pytest.mark.parametrize("ascii_", [True, False])
def test_stl(tmp_path: Path, ascii_: bool) -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 1]]])
    path = tmp_path / "plant.stl"
    if ascii_:
        facets = "".join(
            "facet normal 0 0 0\nouter loop\n"
            + "".join("vertex {} {} {}\n".format(*corner) for corner in face)
            + "endloop\nendfacet\n"
            for face in corners
        )
        path.write_text(f"solid x\n{facets}endsolid x\n")
    else:  # many binary files start with "solid" too
        rows = [struct.pack("<12fH", 0, 0, 0, *face.ravel(), 0) for face in corners]
        path.write_bytes(b"solid".ljust(80) + struct.pack("<I", 2) + b"".join(rows))
    plant = read_plant(path)
    assert np.array_equal(plant.corners, corners)
    assert np.allclose(plant.normals, [[0, 0, 1]] * 3 + [[1, 0, 0]] * 3)
