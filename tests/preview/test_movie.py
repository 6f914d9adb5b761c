"""Films: what is in the files, how long frames are shown, and that they are whole or not there."""

from __future__ import annotations

import sys
import weakref
from collections.abc import Iterator
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from vegtool.arrays import ByteArray
from vegtool.errors import CapabilityError, OutputError, UsageError
from vegtool.preview.movie import check_output, write_frames

KINDS = ["film.png", "film.gif", "film.mp4"]
COLOURS = np.array([[200, 60, 30], [10, 120, 10], [255, 255, 255], [0, 0, 0]], np.uint8)


def needs(name: str) -> None:
    """Skip where PyAV is needed and missing."""
    if name.endswith(".mp4"):
        pytest.importorskip("av", reason="PyAV is not installed: pip install 'vegtool[video]'")


def plain(count: int, height: int = 16, width: int = 24) -> Iterator[ByteArray]:
    """Frames of one colour each."""
    for index in range(count):
        yield np.full((height, width, 3), COLOURS[index % len(COLOURS)], np.uint8)


def names(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def decoded(path: Path) -> list[ByteArray]:
    """The frames of a film, (h, w, 3)."""
    if path.suffix == ".mp4":
        import av

        with av.open(str(path)) as container:
            frames = list(container.decode(video=0))
        # as the tags say, which not every PyAV looks at by itself
        tags = {"src_colorspace": 1, "src_color_range": 1, "dst_color_range": 2}
        return [frame.reformat(format="rgb24", **tags).to_ndarray() for frame in frames]
    with Image.open(path) as image:
        found = []
        for index in range(getattr(image, "n_frames", 1)):
            image.seek(index)
            found.append(np.asarray(image.convert("RGB")))
        return found


@pytest.mark.parametrize("name", ["film.gif", "film.mp4"])
def test_frames_come_out_as_they_went_in(tmp_path: Path, name: str) -> None:
    """Four flat colours: exact in a palette, and to what 8 bits of luma and chroma leave of them in
    H.264. With the wrong matrix, BT.601's, the red one would be off by 15."""
    needs(name)
    movie = write_frames(plain(6), tmp_path / name, 10)
    assert movie.paths == (tmp_path / name,)
    assert (movie.frames, movie.width, movie.height, movie.notes) == (6, 24, 16, ())
    found = decoded(tmp_path / name)
    assert len(found) == 6
    for was, frame in zip(plain(6), found, strict=True):
        np.testing.assert_allclose(frame.astype(int), was, atol=0 if name == "film.gif" else 4)
    assert names(tmp_path) == [name]


def test_a_sequence_is_numbered_from_one(tmp_path: Path) -> None:
    movie = write_frames(plain(3), tmp_path / "a" / "walk.png", 10)
    assert names(tmp_path / "a") == ["walk_0001.png", "walk_0002.png", "walk_0003.png"]
    assert movie.paths == tuple(tmp_path / "a" / name for name in names(tmp_path / "a"))
    for was, path in zip(plain(3), movie.paths, strict=True):
        np.testing.assert_array_equal(decoded(path)[0], was)


@pytest.mark.parametrize("out", ["frames", "is.there"])
def test_a_folder_is_filled_with_a_sequence(tmp_path: Path, out: str) -> None:
    (tmp_path / "is.there").mkdir()
    write_frames(plain(2), tmp_path / out, 10)
    assert names(tmp_path / out) == ["frame_0001.png", "frame_0002.png"]


@pytest.mark.parametrize("fps", [0.5, 24, 30, 29.97, 50])
def test_a_gif_is_as_long_as_its_frames(tmp_path: Path, fps: float) -> None:
    """To a hundredth of a second, whatever a single frame is rounded to; and it repeats."""
    write_frames(plain(31), tmp_path / "film.gif", fps)
    shown = []
    with Image.open(tmp_path / "film.gif") as image:
        assert image.info["loop"] == 0
        for index in range(31):
            image.seek(index)
            shown.append(image.info["duration"] / 10)
    ends = np.cumsum(shown)
    np.testing.assert_allclose(ends, 100 * np.arange(1, 32) / fps, atol=0.5 + 1e-9)
    assert min(shown) >= 2, "browsers show a single hundredth as ten"


def test_a_gif_shares_its_colours_among_all_frames(tmp_path: Path) -> None:
    """A thousand colours of which each frame has a few: none far from one of the 256."""
    ramp = np.stack(np.meshgrid(*[np.linspace(0, 255, 10)] * 3), -1).reshape(-1, 3).astype(np.uint8)
    frames = [np.tile(part.reshape(10, 10, 3), (1, 2, 1)) for part in np.split(ramp, 10)]
    write_frames(frames, tmp_path / "film.gif", 10)
    for was, frame in zip(frames, decoded(tmp_path / "film.gif"), strict=True):
        assert np.abs(frame.astype(float).mean((0, 1)) - was.mean((0, 1))).max() < 8


def test_a_frame_of_many_pixels_is_shown_right_at_its_edges(tmp_path: Path) -> None:
    """Colours of large frames are counted on a part of the pixels."""
    frame = np.zeros((700, 900, 3), np.uint8)
    frame[:, 450:] = [250, 130, 10]
    write_frames([frame], tmp_path / "film.gif", 10)
    np.testing.assert_array_equal(decoded(tmp_path / "film.gif")[0], frame)


@pytest.mark.parametrize("size", [(1, 1), (7, 8), (8, 7), (7, 7)])
def test_odd_sides_are_made_even_for_h264_and_that_is_said(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    needs("film.mp4")
    movie = write_frames(plain(2, *size), tmp_path / "film.mp4", 10)
    even = (size[0] + size[0] % 2, size[1] + size[1] % 2)
    (note,) = movie.notes
    assert f"{size[1]} x {size[0]} pixels became {even[1]} x {even[0]}" in note
    assert (movie.height, movie.width) == even
    found = decoded(tmp_path / "film.mp4")
    assert [frame.shape for frame in found] == [(*even, 3)] * 2
    np.testing.assert_allclose(found[0][-1, -1].astype(int), COLOURS[0], atol=6)


@pytest.mark.parametrize(("fps", "rate"), [(30, "30"), (29.97, "2997/100"), (0.5, "1/2")])
def test_an_mp4_is_what_every_player_shows(tmp_path: Path, fps: float, rate: str) -> None:
    needs("film.mp4")
    import av

    write_frames(plain(4), tmp_path / "film.mp4", fps)
    with av.open(str(tmp_path / "film.mp4")) as container:
        (stream,) = container.streams
        context = stream.codec_context
        assert (context.name, context.pix_fmt) == ("h264", "yuv420p")
        assert (context.colorspace, context.color_range) == (1, 1), "BT.709, 16 to 235"
        assert (context.color_primaries, context.color_trc) == (1, 1)
        times = [frame.pts * frame.time_base for frame in container.decode(stream)]
    assert str(1 / (times[1] - times[0])) == rate
    assert times == [index * times[1] for index in range(4)]
    data = (tmp_path / "film.mp4").read_bytes()
    assert data.index(b"moov") < data.index(b"mdat"), "it plays before it has come whole"


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError])
def test_a_film_that_is_stopped_leaves_nothing(
    tmp_path: Path, name: str, error: type[BaseException]
) -> None:
    needs(name)

    def stopped() -> Iterator[ByteArray]:
        yield from plain(3)
        raise error

    with pytest.raises(error):
        write_frames(stopped(), tmp_path / "new" / name, 10)
    assert names(tmp_path) == []
    old = tmp_path / ("film_0001.png" if name == "film.png" else name)
    old.write_bytes(b"old")
    with pytest.raises(error):
        write_frames(stopped(), tmp_path / name, 10, force=True)
    assert names(tmp_path) == [old.name] and old.read_bytes() == b"old"


@pytest.mark.parametrize("name", KINDS)
def test_what_exists_is_replaced_by_force_alone(tmp_path: Path, name: str) -> None:
    needs(name)
    write_frames(plain(2), tmp_path / name, 10)
    drawn = plain(1)
    with pytest.raises(OutputError, match="exists already"):
        write_frames(drawn, tmp_path / name, 10)
    assert len(list(drawn)) == 1, "refused before anything was drawn"
    write_frames(plain(1), tmp_path / name, 10, force=True)


def test_what_is_left_of_a_longer_sequence_is_said(tmp_path: Path) -> None:
    write_frames(plain(3), tmp_path / "film.png", 10)
    (note,) = write_frames(plain(1), tmp_path / "film.png", 10, force=True).notes
    assert note.startswith(f"{tmp_path / 'film_0002.png'}: is of an older, longer sequence")


@pytest.mark.parametrize("name", KINDS)
def test_frames_do_not_wait_in_memory(tmp_path: Path, name: str) -> None:
    """At most two of a hundred are there at a time: the one that comes and the one that goes; the
    first one is kept to compare sizes with."""
    needs(name)
    alive: list[weakref.ref[ByteArray]] = []
    most = 0

    def watched() -> Iterator[ByteArray]:
        nonlocal most
        for _ in range(100):
            frame = np.zeros((8, 8, 3), np.uint8)
            alive.append(weakref.ref(frame))
            most = max(most, sum(ref() is not None for ref in alive))
            yield frame
            del frame

    write_frames(watched(), tmp_path / name, 10)
    assert most <= 3


@pytest.mark.parametrize("name", KINDS)
def test_progress_is_told_with_each_frame(tmp_path: Path, name: str) -> None:
    needs(name)
    told: list[float] = []
    write_frames(plain(4), tmp_path / name, 10, progress=lambda _, f: told.append(f), count=4)
    assert told == [0, 0.25, 0.5, 0.75, 1]
    told.clear()
    write_frames(plain(2), tmp_path / name, 10, True, lambda _, fraction: told.append(fraction))
    assert told == [0, 0, 1]


@pytest.mark.parametrize("name", KINDS)
def test_no_frames_are_no_film(tmp_path: Path, name: str) -> None:
    needs(name)
    with pytest.raises(UsageError, match="one frame at least"):
        write_frames([], tmp_path / name, 10)
    assert names(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "fps", "says"),
    [
        ("film.avi", 10, r"a folder, or a name that ends in .png, .gif, .mp4; got .avi"),
        ("film.gif", 60, r"0.01 to 50 frames per second in a .gif; got 60"),
        ("film.gif", 0, "got 0"),
        ("film.png", -1, "got -1"),
        ("film.mp4", nan, "got nan"),
        ("film.png", inf, "got inf"),
    ],
)
def test_what_cannot_be_written_is_said_at_once(
    tmp_path: Path, name: str, fps: float, says: str
) -> None:
    with pytest.raises(UsageError, match=says):
        check_output(tmp_path / name, fps)


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros((4, 4, 4), np.uint8),
        np.zeros((4, 4, 3)),
        np.zeros((0, 4, 3), np.uint8),
        np.zeros((5, 4, 3), np.uint8),
    ],
)
def test_frames_of_another_kind_or_size_are_refused(tmp_path: Path, bad: ByteArray) -> None:
    with pytest.raises(ValueError, match=r"^frames: expected"):
        write_frames([np.zeros((4, 4, 3), np.uint8), bad], tmp_path / "film.gif", 10)
    assert names(tmp_path) == []


def test_too_many_pixels_are_refused(tmp_path: Path) -> None:
    needs("film.mp4")
    for name, side in (("film.gif", 65536), ("film.mp4", 16385)):
        with pytest.raises(UsageError, match="pixels on a side"):
            write_frames([np.zeros((1, side, 3), np.uint8)], tmp_path / name, 10)


def test_without_pyav_an_mp4_is_refused_with_what_to_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(CapabilityError, match=r"pip install 'vegtool\[video\]'"):
        write_frames(plain(1), tmp_path / "film.mp4", 10)
    write_frames(plain(1), tmp_path / "film.gif", 10)
