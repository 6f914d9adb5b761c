"""Frames as files: a sequence of PNGs, an animated GIF, or H.264 in an MP4, by the name's ending.

Frames are written as they come; what waits, waits on disk. Whatever goes wrong, Ctrl-C included,
there is either the whole film or none of it.

GIF89a (CompuServe 1990): one palette of 256 colours for all frames, cut by the median from the
colours of all of them (Heckbert: Color image quantization for frame buffer display, 1982), and
dithered. MP4 is written by PyAV, an optional part: H.264 in 4:2:0, BT.709, limited range, which
every player and browser shows.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from math import isfinite
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

import numpy as np

from vegtool.arrays import ByteArray
from vegtool.errors import CapabilityError, UsageError
from vegtool.formats.atomic import FileSet, check_free, explained
from vegtool.formats.png import encode
from vegtool.progress import Progress, silent

FPS_LIMITS = {".png": (0.01, 1000.0), ".gif": (0.01, 50.0), ".mp4": (0.01, 1000.0)}
"""Least and most frames per second. A GIF counts hundredths of a second, and browsers show one of
a single hundredth ten times as long."""
QUALITY = "18"
"""x264's constant rate factor: hardly to be told from the frames."""
_BINS = 32
"""Steps of each channel by which colours are counted for a palette."""
_COUNTED = 2**18
"""About how many pixels of a frame are counted."""
_SAMPLES = 2**17
"""About how many colours the median is cut from."""


@dataclass(frozen=True)
class Movie:
    """What was written. paths: its files. frames: how many. width, height: pixels of each. notes:
    sentences on what is other than one may think."""

    paths: tuple[Path, ...]
    frames: int
    width: int
    height: int
    notes: tuple[str, ...] = ()


class _Files(FileSet):
    """A FileSet with a place for a file that is written bit by bit."""

    def place(self, name: str) -> Path:
        """Where to write a file of the set; it appears under `name` with the others."""
        check_free(self._folder, [name], self._force, self._inputs)
        self._names.append(name)
        return self._new / name

    def waiting_room(self) -> IO[bytes]:
        """A nameless file on the same disk, for what is too much for memory."""
        return TemporaryFile(dir=self._new)


@dataclass(frozen=True)
class _Task:
    """A film to be made. frames: all of one size, (h, w, 3)."""

    frames: Iterator[ByteArray]
    out: Path
    fps: float
    width: int
    height: int


def write_frames(
    frames: Iterable[ByteArray],
    out: Path,
    fps: float,
    force: bool = False,
    progress: Progress = silent,
    count: int | None = None,
) -> Movie:
    """Write frames, each (h, w, 3) uint8 sRGB, top row first, as a film.

    out: `walk.mp4`; `walk.gif`, which repeats for ever; `walk.png` for walk_0001.png and so on; or
    a folder, for frame_0001.png in it. count: how many frames there are going to be, which only
    `progress` wants to know. What already exists is replaced with `force` alone.
    Raises UsageError for another ending, frames per second that the format does not have, and no
    frames at all; OutputError where files may not be written; CapabilityError for MP4 without PyAV;
    ValueError for a frame of another size than the first.
    """
    kind = check_output(out, fps, force)
    counted = _counted(iter(frames), count, progress)
    first = next(counted, None)
    if first is None:
        raise UsageError(f"{out}: expected one frame at least; got none")
    height, width = _checked(first, None).shape[:2]
    same = (_checked(frame, first) for frame in chain([first], counted))
    movie = _WRITERS[kind](_Task(same, out, fps, width, height), force)
    progress("writing frames", 1.0)
    return movie


def check_output(out: Path, fps: float, force: bool = False) -> str:
    """The ending that says how `out` is written, ".png" for a folder.

    To be asked before the first frame is drawn, so that a refusal comes at once.
    Raises UsageError, OutputError and CapabilityError as `write_frames`.
    """
    kind = out.suffix.lower()
    if out.is_dir() or not kind:
        kind = ".png"
    elif kind not in _WRITERS:
        raise UsageError(
            f"{out}: expected a folder, or a name that ends in {', '.join(_WRITERS)}; got {kind}"
        )
    least, most = FPS_LIMITS[kind]
    if not (isfinite(fps) and least <= fps <= most):
        raise UsageError(
            f"{out}: expected {least:g} to {most:g} frames per second in a {kind}; got {fps:g}"
        )
    folder, name = _sequence(out)
    check_free(folder, [f"{name}_0001.png"] if kind == ".png" else [out.name], force)
    if kind == ".mp4":
        _av(out)
    return kind


def _write_pngs(task: _Task, force: bool) -> Movie:
    folder, name = _sequence(task.out)
    count = 0
    with _Files(folder, force) as files:
        for count, frame in enumerate(task.frames, start=1):
            files.add(f"{name}_{count:04d}.png", encode(frame))
    notes: tuple[str, ...] = ()
    after = folder / f"{name}_{count + 1:04d}.png"
    if after.exists():
        notes = (f"{after}: is of an older, longer sequence, and so may be those after it",)
    return Movie(tuple(files.paths), count, task.width, task.height, notes)


def _write_gif(task: _Task, force: bool) -> Movie:
    _check_sides(task, 65535)
    with (
        _Files(task.out.parent, force) as files,
        explained(task.out),
        files.waiting_room() as waiting,
        files.place(task.out.name).open("wb") as gif,
    ):
        counts = np.zeros(_BINS**3, np.int64)
        sums = np.zeros((3, _BINS**3))
        sizes = []
        for frame in task.frames:
            _count_colours(frame, counts, sums)
            packed = zlib.compress(frame.tobytes(), 1)
            waiting.write(packed)
            sizes.append(len(packed))
        waiting.seek(0)
        palette = _palette(counts, sums)
        gif.write(_gif_header(task.width, task.height, palette))
        for index, size in enumerate(sizes):
            pixels = np.frombuffer(zlib.decompress(waiting.read(size)), np.uint8)
            frame = pixels.reshape(task.height, task.width, 3)
            # rounded where frames begin, so that what is lost at one is made up for at the next
            begins, ends = (round(100 * i / task.fps) for i in (index, index + 1))
            gif.write(_gif_frame(frame, palette, ends - begins))
        gif.write(b";")
    return Movie(tuple(files.paths), len(sizes), task.width, task.height)


def _write_mp4(task: _Task, force: bool) -> Movie:
    _check_sides(task, 16384)
    av = _av(task.out)
    width, height = task.width + task.width % 2, task.height + task.height % 2
    with _Files(task.out.parent, force) as files, explained(task.out):
        try:
            count = _encode(av, files.place(task.out.name), task, width, height)
        except av.error.FFmpegError as error:
            if isinstance(error, OSError):
                raise
            raise CapabilityError(
                f"{task.out}: FFmpeg cannot write this film ({error}); write a .gif or .png"
            ) from error
    notes: tuple[str, ...] = ()
    if (width, height) != (task.width, task.height):
        notes = (
            f"{task.out}: frames of {task.width} x {task.height} pixels became {width} x {height}, "
            "their last row or column repeated: H.264 has even sides alone",
        )
    return Movie(tuple(files.paths), count, width, height, notes)


def _encode(av: Any, place: Path, task: _Task, width: int, height: int) -> int:
    """Write the frames, their edges repeated up to that size; how many they were."""
    rate = Fraction(task.fps).limit_denominator(1001)
    more = ((0, height - task.height), (0, width - task.width), (0, 0))
    count = 0
    # the index comes first, so that a player may begin before it has the whole file
    with av.open(str(place), "w", format="mp4", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=rate, options={"crf": QUALITY})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        context = stream.codec_context
        context.color_primaries = context.color_trc = context.colorspace = _BT709
        context.color_range = _LIMITED
        for count, frame in enumerate(task.frames, start=1):
            picture = av.VideoFrame.from_ndarray(np.pad(frame, more, "edge"), format="rgb24")
            picture = picture.reformat(
                format="yuv420p",
                src_color_range=_FULL,
                dst_color_range=_LIMITED,
                dst_colorspace=_BT709,
            )
            picture.pts, picture.time_base = count - 1, 1 / rate
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))
    return count


def _check_sides(task: _Task, most: int) -> None:
    if max(task.width, task.height) > most:
        raise UsageError(
            f"{task.out}: expected at most {most} pixels on a side; got {task.width} x "
            f"{task.height}; draw smaller frames, or write .png"
        )


_BT709 = 1
"""ITU-T H.273: primaries, transfer and matrix of BT.709; of pictures in sRGB, which has the same
primaries, players take the transfer for what they do by default."""
_LIMITED, _FULL = 1, 2
"""FFmpeg's AVColorRange: luma 16 to 235, and 0 to 255."""

_WRITERS: dict[str, Callable[[_Task, bool], Movie]] = {
    ".png": _write_pngs,
    ".gif": _write_gif,
    ".mp4": _write_mp4,
}
"""Ending -> who writes it."""


def _av(out: Path) -> Any:
    """PyAV, with an encoder of H.264."""
    try:
        import av
    except ImportError as error:
        raise CapabilityError(
            f"{out}: MP4 is written by PyAV, which is not installed; install it with: "
            "pip install 'vegtool[video]', or write a .gif or .png"
        ) from error
    if "libx264" not in av.codecs_available:
        raise CapabilityError(
            f"{out}: expected a PyAV with the encoder libx264; this one was built without; "
            "install it from its wheels: pip install --force-reinstall --only-binary av av"
        )
    return av


def _sequence(out: Path) -> tuple[Path, str]:
    """The folder that files go to, and what names of a sequence of PNGs begin with."""
    if out.suffix.lower() in _WRITERS and not out.is_dir():
        return out.parent, out.stem
    return out, "frame"


def _counted(
    frames: Iterator[ByteArray], count: int | None, progress: Progress
) -> Iterator[ByteArray]:
    """The frames; the fraction that is done is told with each, 0 where nobody knows it."""
    for done, frame in enumerate(frames):
        progress("writing frames", min(done / count, 1.0) if count else 0.0)
        yield frame


def _checked(frame: ByteArray, first: ByteArray | None) -> ByteArray:
    """A frame that is one, and of the first one's size."""
    if frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3 or not frame.size:
        raise ValueError(f"frames: expected (h, w, 3) uint8; got {frame.shape} {frame.dtype}")
    if first is not None and frame.shape != first.shape:
        raise ValueError(f"frames: expected all of {first.shape}; got {frame.shape}")
    return frame


def _count_colours(frame: ByteArray, counts: np.ndarray, sums: np.ndarray) -> None:
    """Add a frame's pixels, or some of many, to how many are in each bin, (b,), and to the sums of
    their colours, (3, b)."""
    pixels = frame.reshape(-1, 3)
    channels = pixels[:: len(pixels) // _COUNTED + 1].T.astype(np.int64)
    red, green, blue = channels * _BINS // 256
    bins = (red * _BINS + green) * _BINS + blue
    counts += np.bincount(bins, minlength=len(counts))
    for total, channel in zip(sums, channels, strict=True):
        total += np.bincount(bins, channel, len(total))


def _palette(counts: np.ndarray, sums: np.ndarray) -> Any:
    """A Pillow image whose palette is the median cut of what was counted.

    Colours are taken as often as they are seen, and each once at least.
    """
    from PIL import Image

    seen = counts > 0
    colours = np.rint(sums[:, seen] / counts[seen]).astype(np.uint8).T
    often = np.ceil(counts[seen] * (_SAMPLES / counts.sum())).astype(np.int64)
    samples = np.repeat(colours, often, axis=0)
    return Image.fromarray(samples[None]).quantize(256, Image.Quantize.MEDIANCUT)


def _gif_header(width: int, height: int, palette: Any) -> bytes:
    """Up to the first frame: the screen, the palette, and that the film repeats for ever."""
    colours = bytes(palette.getpalette()).ljust(768, b"\0")[:768]
    screen = struct.pack("<6sHHBBB", b"GIF89a", width, height, 0xF7, 0, 0)
    return screen + colours + b"!\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"


def _gif_frame(frame: ByteArray, palette: Any, hundredths: int) -> bytes:
    """A frame's blocks, dithered with the palette."""
    from PIL import Image

    image = Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.FLOYDSTEINBERG)
    control = struct.pack("<4sHBB", b"!\xf9\x04\x00", hundredths, 0, 0)
    place = struct.pack("<sHHHHB", b",", 0, 0, *image.size, 0)
    return control + place + b"\x08" + image.tobytes("gif", "P", 8, 0) + b"\x00"
