"""Tiles of surfels to walk through: how many are drawn from where, and what follows what."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cards import cards
from surfel_sets import ball

from vegtool.errors import InputError
from vegtool.formats.gltf import plant_glb
from vegtool.formats.gltf_tile import surfels_glb
from vegtool.formats.tileset import BLENDED, CLIENT_PX, TILESET, TileEntry, tileset_files
from vegtool.gl.context import framebuffer_kept
from vegtool.preview import tile_store
from vegtool.preview.eye import Eye, towards
from vegtool.preview.fovea import Fovea
from vegtool.preview.palette import COLORS
from vegtool.preview.scenery import Look
from vegtool.preview.tile_forest import TileForest
from vegtool.preview.tile_world import TileWorld, read_tile_world

pytestmark = pytest.mark.gl
SIZE = 160, 120
FOCAL = 120 / 2 / np.tan(np.radians(30))
GIVES_WAY = 40.0
"""Metres from the box of the root, at which it gives way to its quarters."""
ERROR = GIVES_WAY * CLIENT_PX / FOCAL


def entry(name: str, x: float, error: float, surfels: int, *children: TileEntry) -> TileEntry:
    """A tile of 4 m about a place."""
    origin = np.array([x, 0.0, 0.0])
    half = 2.0 if not children else 4.0
    bounds = np.stack([origin - half, origin + half])
    return TileEntry(f"tiles/{name}.glb", origin, bounds, error, 1, (0.0, 0.0), children, surfels)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two balls of a radius of 2 m: as one set; below, one as a set of its own, the other as a
    card, which is geometry."""
    place = tmp_path_factory.mktemp("balls")
    (place / "tiles").mkdir()
    left, right = (ball(800, 2.0, (x, 0, 0)) for x in (-2.0, 2.0))
    both = replace(
        ball(1600, 2.0), position=np.stack([left.position, right.position], 1).reshape(-1, 3),
        normal=np.repeat(left.normal, 2, axis=0), color=np.repeat(left.color, 2, axis=0),
    )  # fmt: skip
    card = cards(np.zeros((1, 3)), 2.0)
    for name, data in (
        ("root", surfels_glb(both, "root")),
        ("set", surfels_glb(left.moved(np.array([2.0, 0, 0])), "set")),
        ("card", plant_glb(card)),
    ):
        (place / "tiles" / f"{name}.glb").write_bytes(data)
    below = entry("set", -2.0, 0.0, 800), entry("card", 2.0, 0.0, 0)
    root = entry("root", 0.0, ERROR, 1600, *below)
    (place / TILESET).write_bytes(tileset_files(root, None)[TILESET])
    return place


def loaded(place: Path) -> tuple[TileWorld, TileForest]:
    world = read_tile_world(place / TILESET)
    forest = replace(world, ground=None).scenery("none")
    for _ in forest.load():
        pass
    return world, forest


def away(metres: float) -> Eye:
    """So far before the root's box."""
    place = np.array([0.0, 0.0, 4.0 + metres])
    return Eye(place, *towards(-place), 60.0)


def test_what_is_told_of_surfels(folder: Path) -> None:
    world = read_tile_world(folder / TILESET)
    assert world.progressive and world.tileset.surfels.tolist() == [1600, 800, 0]
    told = world.details(FOCAL)
    assert told[0] == f"level 1: 1 tiles, 1,600 surfels, drawn from {GIVES_WAY:.3g} m"


def test_a_tile_gives_way_to_its_quarters_bit_by_bit(folder: Path) -> None:
    """Beyond the range it is whole and alone, at its middle both are whole, at its end none of it
    is left; all in between grows and falls in a straight line. Geometry is drawn as soon as any of
    it is wanted."""
    _, forest = loaded(folder)
    with forest:
        for part, own, others in (
            (1.001, 1.0, 0.0), (0.75, 1.0, 0.5), (0.5, 1.0, 1.0), (0.25, 0.5, 1.0),
            (0.01, 0.02, 1.0), (-0.001, 0.0, 1.0),
        ):  # fmt: skip
            shown = forest.chosen(away(GIVES_WAY * (1 + BLENDED * part)), SIZE, Look())
            shares = dict(zip(shown.tile.tolist(), shown.share.tolist(), strict=True))
            expected = {0: own, 1: others, 2: others}
            assert {k: v for k, v in expected.items() if v} == pytest.approx(shares, abs=0.01)
            assert dict(zip(shown.tile, shown.below, strict=True)) == {
                tile: bool(tile and own) for tile in shares
            }
        held = forest.chosen(away(GIVES_WAY * 1.1), SIZE, Look(level=1))
        assert held.tile.tolist() == [0] and held.share.tolist() == [1.0], "one level, no other"


def test_plants_are_counted_once_and_surfels_are_told(folder: Path) -> None:
    _, forest = loaded(folder)
    with forest:
        landscape = forest._loaded("test")
        with framebuffer_kept(landscape.ctx):
            target = landscape.ctx.simple_framebuffer(SIZE)
            target.use()
            stats = forest.draw(away(GIVES_WAY * 1.1), SIZE)
            target.release()
        assert stats.tiles == 3 and stats.plants == 1
        assert stats.said[0].endswith(" surfels") and stats.triangles == 2


def test_nothing_pops(folder: Path) -> None:
    """Where surfels follow surfels, a step of a centimetre changes no more than a few of them; at
    the ends of the range as within it."""
    _, forest = loaded(folder)
    with forest:
        for part in (1.0, 0.5, 0.0):
            at = GIVES_WAY * (1 + BLENDED * part)
            one, other = (
                forest.picture(away(at + step), SIZE)[:, : SIZE[0] // 2] for step in (-0.01, 0.01)
            )
            covered = one[..., 3].sum()
            assert covered > 40 and np.abs(one - other)[..., 3].sum() < 0.02 * covered


def test_as_many_surfels_as_pixels_ask_for(folder: Path) -> None:
    """p(r) at what is nearest of the surfels' own bounds, not of the box, which may be larger; of
    pixels of twice the size, a quarter; at the border of a headset's picture too."""
    world, forest = loaded(folder)
    eye = away(150.0)
    with forest:
        counts = []
        for look in (
            Look(), Look(surfel_px=2.0), Look(fovea=Fovea((0.0,), (2.0,))),
        ):  # fmt: skip
            frame = forest._frame(eye, SIZE, forest.chosen(eye, SIZE, look), look)
            (points,) = frame.points
            counts.append(int(points.prefix[0]))
        nearest = 154.0 - 2.0
        radius = nearest / eye.focal_px(SIZE[1]) / 2
        spacing = forest._loaded("test").surfels(frame.points[0].surfels).surfels.spacing
        assert counts[0] == spacing.prefix(radius)
        assert counts[1] == counts[2] == pytest.approx(counts[0] / 4, abs=1.0)
        assert world.tileset.surfels[0] == spacing.total


def test_levels_have_colours(folder: Path) -> None:
    _, forest = loaded(folder)
    with forest:
        near, far = (
            forest.picture(away(metres), SIZE, Look(color=COLORS[1]))[:, : SIZE[0] // 2]
            for metres in (20.0, 100.0)
        )
        hues = [p[p[..., 3] > 0.9][:, :3].mean(axis=0) for p in (near, far)]
        assert np.abs(hues[0] / hues[0].max() - hues[1] / hues[1].max()).max() > 0.2


def test_sets_that_nobody_looks_at_are_forgotten(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those drawn before last, where there is no room; and what is drawn again is read again."""
    monkeypatch.setattr(tile_store, "MOST_BYTES", 1)
    _, forest = loaded(folder)
    with forest:
        store, landscape = forest._store, forest._loaded("test")
        assert store is not None
        pictures = []
        for tiles in ([0], [1], [2], [0]):
            (held, *_) = store.held(tiles)
            pictures.append(held)
            assert len(landscape._surfels) <= 2
        assert len(store) == 2 and pictures[0].surfels != pictures[3].surfels
        held_bytes = sum(one.bytes for one in store._held.values())
        assert 0 < store.bytes - held_bytes < 2000, "the card, and its texture of a texel"


@pytest.mark.parametrize("what", ["cut", "text", "geometry", "gone"])
def test_a_broken_tile_of_surfels_is_a_sentence(folder: Path, tmp_path: Path, what: str) -> None:
    """That names the file."""
    (tmp_path / "tiles").mkdir()
    for file in ("root.glb", "set.glb", "card.glb"):
        (tmp_path / "tiles" / file).write_bytes((folder / "tiles" / file).read_bytes())
    (tmp_path / TILESET).write_bytes((folder / TILESET).read_bytes())
    root = tmp_path / "tiles" / "root.glb"
    _, forest = loaded(tmp_path)
    data = root.read_bytes()
    root.write_bytes({"cut": data[:-200], "text": b"glTF?", "gone": b""}.get(what, b""))
    if what == "geometry":
        root.write_bytes(plant_glb(cards(np.zeros((1, 3)))))
    if what == "gone":
        root.unlink()
    with forest, pytest.raises(InputError, match=r"root\.glb"):
        forest.picture(away(100.0), SIZE)


def test_numbers_of_surfels_that_are_none(folder: Path, tmp_path: Path) -> None:
    values = json.loads((folder / TILESET).read_bytes())
    values["root"]["extras"]["surfels"] = "many"
    for file in ("root", "set", "card"):
        (tmp_path / "tiles").mkdir(exist_ok=True)
        (tmp_path / "tiles" / f"{file}.glb").write_bytes(b"")
    (tmp_path / TILESET).write_text(json.dumps(values))
    with pytest.raises(InputError, match="expected a tileset"):
        read_tile_world(tmp_path / TILESET)
