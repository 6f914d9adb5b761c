"""What a level costs: to store, to draw, to make."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from vegtool.gl.upload import PlantBuffers
from vegtool.lighting.light import Light
from vegtool.lod import Level
from vegtool.measure.pictures import fragments, frame_seconds, renderer, uploaded
from vegtool.measure.views import Camera

FRAMES = 30
"""Frames timed, at least."""
_PROCESS = Path("/proc/self")


@dataclass(frozen=True)
class FrameTime:
    """Milliseconds of a frame: median and quartiles of so many, and what drew them."""

    median_ms: float
    quartiles_ms: tuple[float, float]
    frames: int
    renderer: str


@dataclass(frozen=True)
class Cost:
    """What a level costs.

    triangles, texels: as in Level. billboards: 0 for a mesh. bytes: of its file, or None.
    draw_calls: one per material with faces. fragments_per_pixel: fragments that would be shaded if
    nothing hid anything, per pixel that the truth covers, median over the views; None where it
    covers none. seconds: by stage of making it. peak_mb: most memory while it was made, or None.
    """

    triangles: int
    billboards: int
    texels: int
    bytes: int | None
    draw_calls: int
    fragments_per_pixel: float | None
    frame: FrameTime
    seconds: dict[str, float]
    peak_mb: float | None


def cost(
    level: Level,
    cameras: Sequence[Camera],
    covered: Sequence[float],
    light: Light | None = None,
    file_bytes: int | None = None,
    peak_mb: float | None = None,
) -> Cost:
    """Draw a level as a client does, count and time it.

    cameras: the views, at the size that fragments and frame times are stated for, one at least.
    covered: pixels that the truth covers in each. file_bytes, peak_mb: of its file and of making
    it, which the caller knows. Raises CapabilityError where nothing can draw.
    """
    with uploaded(level) as buffers:
        shaded = [fragments(buffers, camera) for camera in cameras]
        each = -(-FRAMES // len(cameras))
        times = [frame_seconds(buffers, camera, light, each) for camera in cameras]
        draw_calls = len(buffers.groups) if isinstance(buffers, PlantBuffers) else 1
    shares = [n / pixels for n, pixels in zip(shaded, covered, strict=True) if pixels > 0]
    return Cost(
        triangles=level.triangles,
        billboards=0 if level.billboards is None else len(level.billboards),
        texels=level.texels,
        bytes=file_bytes,
        draw_calls=draw_calls,
        fragments_per_pixel=float(np.median(shares)) if shares else None,
        frame=frame_time(np.concatenate(times)),
        seconds=dict(level.seconds),
        peak_mb=peak_mb,
    )


def frame_time(seconds: Sequence[float] | np.ndarray) -> FrameTime:
    """The median of frames that took so many seconds each, with quartiles."""
    low, median, high = (1e3 * float(q) for q in np.quantile(seconds, (0.25, 0.5, 0.75)))
    return FrameTime(median, (low, high), len(seconds), renderer()["renderer"])


@dataclass
class Peak:
    """mb: most resident memory of the process, in units of 2^20 bytes, once the block has ended;
    None where the system does not tell."""

    mb: float | None = field(default=None)


@contextmanager
def peak_memory() -> Iterator[Peak]:
    """Measure the peak memory of a block: of the whole process, what it held before included.

    Linux alone can forget an earlier peak (proc(5): 5 written to clear_refs resets VmHWM);
    elsewhere, and where that is not allowed, there is no number rather than a wrong one. Blocks
    must not be nested.
    """
    peak = Peak()
    try:
        (_PROCESS / "clear_refs").write_text("5")
        forgotten = True
    except OSError:
        forgotten = False
    try:
        yield peak
    finally:
        if forgotten:
            status = (_PROCESS / "status").read_text()
            peak.mb = int(status.split("VmHWM:")[1].split()[0]) / 1024
