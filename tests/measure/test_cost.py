"""What a level costs, on squares whose fragments can be counted on paper."""

from __future__ import annotations

import sys
from mmap import mmap
from pathlib import Path

import numpy as np
import pytest
from hybrids import hybrid_of

from vegtool.growth import sample
from vegtool.lod import Level
from vegtool.measure import cost as module
from vegtool.measure.cost import FRAMES, cost, frame_time, peak_memory
from vegtool.measure.views import Camera
from vegtool.plant import Material, Plant

MB = 2**20


def squares(*depths: float, materials: int = 1) -> Level:
    """Squares a metre wide, one behind the other, facing +z; each of one of the materials."""
    corner = np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [0.5, 0.5, 0], [-0.5, 0.5, 0]])
    positions = np.concatenate([corner + np.array([0, 0, z]) for z in depths])
    n = len(depths)
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * i for i in range(n)])
    normals = np.tile([0.0, 0, 1], (4 * n, 1))
    which = np.repeat(np.arange(n) % materials, 2).astype(np.int32)
    made = tuple(Material(f"m{i}", double_sided=True) for i in range(materials))
    plant = Plant("squares", positions, normals, np.zeros((4 * n, 2)), faces, which, made)
    return Level("mesh", mesh=plant, seconds={"clustering": 0.5})


def camera(pixels: float = 32.0) -> Camera:
    """Far away, a metre covers that many pixels."""
    return Camera(np.zeros(3), np.array([0.0, 0, 1]), 1e4, 1e4 * pixels, 64, 64, (32.0, 32.0), 5.0)


@pytest.mark.gl
@pytest.mark.parametrize("depths", [(0,), (-1, 0, 1), (1, 0, -1)])
def test_each_square_is_shaded_where_it_covers(depths: tuple[float, ...]) -> None:
    """Hidden ones too, in whatever order: 32 x 32 pixels each."""
    found = cost(squares(*depths), [camera()], [32.0 * 32.0])
    assert found.fragments_per_pixel == pytest.approx(len(depths), abs=0.01)


@pytest.mark.gl
def test_the_median_view_counts_and_views_of_nothing_do_not() -> None:
    cameras = [camera(8), camera(16), camera(32)]
    found = cost(squares(0), cameras, [64.0, 256.0 / 2, 1024.0 / 4])
    assert found.fragments_per_pixel == pytest.approx(2, abs=0.1)
    found = cost(squares(0), cameras, [0, 256.0, 0])
    assert found.fragments_per_pixel == pytest.approx(1, abs=0.1)
    assert cost(squares(0), cameras, [0, 0, 0]).fragments_per_pixel is None


@pytest.mark.gl
def test_one_draw_call_per_material_and_what_the_level_says_of_itself() -> None:
    level = squares(0, 1, 2, materials=2)
    found = cost(level, [camera()], [1024.0], file_bytes=1234, peak_mb=56.5)
    assert (found.draw_calls, found.triangles, found.billboards) == (2, 6, 0)
    assert (found.texels, found.bytes, found.peak_mb) == (0, 1234, 56.5)
    assert found.seconds == {"clustering": 0.5}
    assert found.frame.renderer
    assert found.frame.frames >= FRAMES
    low, high = found.frame.quartiles_ms
    assert 0 < low <= found.frame.median_ms <= high
    assert cost(level, [camera()] * 7, [1024.0] * 7).frame.frames >= FRAMES


@pytest.mark.gl
def test_a_hybrid_is_one_draw_call_for_both_of_its_parts() -> None:
    plant = sample("bush", 500)
    level = hybrid_of(plant, 12, 20.0)
    found = cost(level, [camera()], [1024.0])
    assert level.billboards is not None and level.atlas is not None
    assert (found.draw_calls, found.billboards) == (1, len(level.billboards))
    assert found.triangles == (~plant.face_is_leaf).sum() + 2 * len(level.billboards)
    assert found.texels == 2 * level.atlas.texels


@pytest.mark.gl
def test_frame_times_are_medians_in_milliseconds() -> None:
    time = frame_time(np.array([1, 2, 3, 4, 100]) * 1e-3)
    assert time.median_ms == pytest.approx(3)
    assert time.quartiles_ms == pytest.approx((2, 4))


linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells the peak of a block")


def held(count: int) -> None:
    """Take memory from the system, not from what the process has spare, and give it back."""
    with mmap(-1, count) as memory:
        for page in range(0, count, 4096):
            memory[page] = 1


@linux
def test_the_peak_of_a_block_is_its_own() -> None:
    """Megabytes let go before it do not count; those held within it for a while do. A fifth is room
    for what other threads, and the system, do with the process meanwhile."""
    held(100 * MB)
    with peak_memory() as idle:
        pass
    with peak_memory() as peak:
        held(100 * MB)
    assert idle.mb is not None and peak.mb is not None
    assert peak.mb - idle.mb == pytest.approx(100, rel=0.2)


@linux
def test_the_peak_is_known_after_a_failure_too() -> None:
    with pytest.raises(ZeroDivisionError), peak_memory() as peak:
        _ = 1 // 0
    assert peak.mb is not None


def test_where_the_system_does_not_tell_there_is_no_number(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(module, "_PROCESS", tmp_path / "nowhere")
    with peak_memory() as peak:
        pass
    assert peak.mb is None
