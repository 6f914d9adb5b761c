"""A hybrid as a level: its mesh shows the original, and files keep it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vegtool.convert import ConvertOptions, convert
from vegtool.errors import UsageError
from vegtool.formats import read_plant
from vegtool.formats.gltf import write_chain
from vegtool.gl.upload import PlantBuffers
from vegtool.hybrid.charts import cones, neighbours
from vegtool.hybrid.cloud import cloud_of
from vegtool.hybrid.level import drawn_as
from vegtool.hybrid.mesh import colored
from vegtool.hybrid.options import Budget, Weights
from vegtool.hybrid.start import begun
from vegtool.lod import Display, Level, LodChain, level_triangles
from vegtool.measure.chain import views_of
from vegtool.measure.options import MeasureOptions
from vegtool.measure.scores import TruthsAt, scores
from vegtool.plant import Material, Plant, Texture
from vegtool.refine.level import Wanted, source_of

NEAR_M = 12.0


def ball(rings: int = 16, sides: int = 24, textured: bool = True) -> Plant:
    """A ball of a metre, as a map of longitude and latitude, chequered on request."""
    up, around = np.meshgrid(
        np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, sides + 1), indexing="ij"
    )
    points = np.stack([np.sin(up) * np.cos(around), np.cos(up), np.sin(up) * np.sin(around)], -1)
    uvs = np.stack([around / (2 * np.pi), up / np.pi], axis=-1)
    row = np.arange(rings)[:, None] * (sides + 1) + np.arange(sides)
    quads = np.stack([row, row + 1, row + sides + 2, row + sides + 1], axis=-1).reshape(-1, 4)
    faces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]).astype(np.int32)
    chequer = (np.indices((64, 128)) // 16).sum(axis=0) % 2 == 0
    pixels = np.where(chequer[..., None], [220, 60, 40, 255], [40, 80, 200, 255]).astype(np.uint8)
    texture = Texture("chequer", pixels) if textured else None
    flat = points.reshape(-1, 3)
    return Plant(
        "ball", flat, flat, uvs.reshape(-1, 2), faces, np.zeros(len(faces), np.int32),
        (Material("ball", color_texture=texture),),
    )  # fmt: skip


@pytest.fixture(scope="module")
def made() -> tuple[Plant, Level, TruthsAt]:
    """A ball as a mesh of few triangles with pictures, and its truth."""
    plant = ball()
    with PlantBuffers(plant) as buffers:
        truth_at = TruthsAt(plant, views_of(MeasureOptions()), Display(), buffers)
        source = source_of(buffers, truth_at)
        start = begun(cloud_of(plant, 6), Weights(1.0, 0.3, 1.0))
        whole = start.proposal(np.flatnonzero(start.solid))
        start.accept(whole)
        level = drawn_as(source, Wanted(200, NEAR_M), start)
        truth_at(NEAR_M)
        return plant, level, truth_at


pytestmark = pytest.mark.gl


def test_a_mesh_shows_the_original_beneath_it(made: tuple[Plant, Level, TruthsAt]) -> None:
    """A chequered ball of a tenth of its triangles: coloured by vertices all would be violet."""
    plant, level, truth_at = made
    assert level.kind == "hybrid" and level.charts is not None and level.mesh is not None
    assert len(level.mesh.faces) < len(plant.faces) / 4
    found = scores(truth_at(NEAR_M), level).values
    assert float(found["flip"].mean()) < 0.1, "of which most is the outline of 94 triangles"
    bare = replace(level, charts=None, mesh=replace(level.mesh, colors=np.full_like(
        level.mesh.colors, 0.3)))  # fmt: skip
    worse = scores(truth_at(NEAR_M), bare).values
    assert float(found["flip"].mean()) < 0.5 * float(worse["flip"].mean())


def test_pictures_are_opaque_and_faces_within_them(made: tuple[Plant, Level, TruthsAt]) -> None:
    _, level, _ = made
    assert level.atlas is not None and level.atlas.charts is not None and level.charts is not None
    drawn = level_triangles(level)
    height, width = level.atlas.color.shape[:2]
    assert level.mesh is not None
    first = len(drawn.positions) - len(np.unique(level.mesh.faces))
    for x, y, w, h in level.atlas.charts.tolist():
        assert (level.atlas.color[y : y + h, x : x + w, 3] == 255).all()
    place = drawn.uvs[first:] * [width, height]
    corners = place[(drawn.indices.reshape(-1, 3)[len(level.billboards or ()) * 2 :] - first)]
    for face, chart in enumerate(level.charts.of_face.tolist()):
        if chart >= 0:
            x, y, w, h = level.atlas.charts[chart].tolist()
            assert (corners[face] >= [x - 1e-6, y - 1e-6]).all()
            assert (corners[face] <= [x + w + 1e-6, y + h + 1e-6]).all()


def test_what_is_written_is_what_is_drawn(
    made: tuple[Plant, Level, TruthsAt], tmp_path: Path
) -> None:
    plant, level, _ = made
    chain = LodChain("ball", (Level("mesh", mesh=plant), level), Display(), 0)
    write_chain(chain, tmp_path)
    found, wanted = read_plant(tmp_path / "ball_LOD1.glb"), level_triangles(level)
    assert len(found.faces) == level.triangles and len(found.materials) == 1
    size = wanted.positions.max() - wanted.positions.min()
    np.testing.assert_allclose(
        np.sort(found.corners.reshape(-1, 3), axis=0),
        np.sort(wanted.positions[wanted.indices], axis=0), atol=1e-5 * size,
    )  # fmt: skip


def test_charts_look_one_way_and_hang_together() -> None:
    """Of a ball: no face is more than the cone from the first of its chart, all are of one."""
    plant = ball(textured=False)
    start = begun(cloud_of(plant, 6), Weights(1.0, 0.3, 1.0))
    start.accept(start.proposal(np.flatnonzero(start.solid)))
    mesh = colored(plant, start.parts.values())
    assert mesh is not None
    chart, axis = cones(mesh)
    assert chart.min() == 0 and len(axis) == chart.max() + 1
    normal = mesh.plant.face_area_vectors
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    assert (np.einsum("fi,fi->f", normal, axis[chart]) > 0.2).all()
    assert 4 <= len(axis) <= 40
    beside = neighbours(mesh.place)
    for number in range(len(axis)):
        own = set(np.flatnonzero(chart == number).tolist())
        reached, waiting = set(), [min(own)]
        while waiting:
            one = waiting.pop()
            if one not in reached:
                reached.add(one)
                waiting += [other for other in beside[one] if other in own]
        assert reached == own


def test_a_budget_is_kept() -> None:
    from vegtool.hybrid.budget import within

    start = begun(cloud_of(ball(textured=False), 12), Weights())
    for triangles in (60, 200):
        found = within(start, Budget(triangles))
        assert found.triangles <= triangles
        tight = within(start, Budget(triangles, fill=0.9 * found.terms.fill))
        assert tight.triangles <= triangles and tight.terms.fill <= 0.9 * found.terms.fill + 1e-9


def test_convert_makes_hybrids() -> None:
    """Half of the triangles each time; the same twice."""
    options = ConvertOptions(method="hybrid", triangles=120, levels=2, pixels=64.0)
    off = MeasureOptions(measure="off")
    one, other = (convert(ball(), options, off) for _ in range(2))
    most = (120, 60)
    assert len(one.levels) == 3
    for level, again, count in zip(one.levels[1:], other.levels[1:], most, strict=True):
        assert 0 < level.triangles <= count
        assert level.atlas is not None and again.atlas is not None
        assert level.atlas.color.tobytes() == again.atlas.color.tobytes()


def test_a_hybrid_has_a_shadow() -> None:
    """What throws it is made as for other levels: pictures of the mesh have no use in white."""
    options = ConvertOptions(method="hybrid", levels=1, pixels=64.0, shadow_proxy=40)
    made = convert(ball(), options, MeasureOptions(measure="off"))
    assert made.shadow is not None and made.shadow.level.charts is None
    assert 0 < made.shadow.level.triangles <= 40


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"weights": "error=1,colour=2"}, "--weights: expected error, polygons, fill"),
        ({"weights": "error=x"}, "got 'error=x'"),
        ({"weights": "fill=-1"}, "got 'fill=-1'"),
        ({"weights": "error=1", "triangles": 10}, "--triangles, --fill"),
        ({"shape": "crossed"}, "--shape: is the plain method's"),
        ({"orientation_weight": 0.5}, "--orientation-weight: is the plain method's"),
        ({"refine": "none"}, "--method hybrid: goes with --refine full"),
    ],
)
def test_what_a_hybrid_cannot_be_is_a_sentence(given: dict[str, object], told: str) -> None:
    with pytest.raises(UsageError, match=told):
        ConvertOptions(method="hybrid", **given)  # type: ignore[arg-type]


def test_options_of_hybrids_are_refused_elsewhere() -> None:
    with pytest.raises(UsageError, match="--fill: is of another method alone; add --method hybrid"):
        ConvertOptions(fill=1.0)


def test_weights_are_read() -> None:
    assert Weights.read("error=2, fill=0") == Weights(2.0, 1.0, 0.0)
    assert Weights.read("polygons=1e9") == Weights(polygons=1e9)
