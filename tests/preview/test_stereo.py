"""Two eyes side by side, and a place whose surfels are sized by the time that there is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cards import cards
from stereo_cases import check_two_eyes
from walk_cases import OPAQUE, Garden, bush, herb, plants, species_of, world_of

from vegtool.preview.controls import Fly
from vegtool.preview.drawn import show_of
from vegtool.preview.eye import Eye
from vegtool.preview.fovea import Fovea
from vegtool.preview.governor import Governor
from vegtool.preview.options import PreviewOptions
from vegtool.preview.run import SETTLING, frames, loaded, settle, timed_frames
from vegtool.preview.scenery import FrameStats, Look
from vegtool.preview.show import EYES, PANELS, SKY, Show, of_both, two_eyes
from vegtool.preview.size_control import LARGEST_PX, LATE_FRAMES, MEDIAN_FRAMES, SizeControl
from vegtool.preview.state import State, pressed
from vegtool.preview.world import World
from vegtool.srgb import srgb_from_linear

EYE = Eye(np.array([0.5, 1.6, 9.0]), 3.0, -4.0)
FEET = [[0, 0, 4], [-1, 0, 0], [0.4, 0, 8]]


# -- the eyes --------------------------------------------------------------------------------------


def test_eyes_are_64_mm_apart_and_look_the_same_way() -> None:
    """Along the eye's own right, whichever way it looks; between them is where it was."""
    for eye in (EYE, Eye(np.zeros(3), 130.0, 60.0, fov_y_deg=40.0)):
        left, right = two_eyes(eye)
        np.testing.assert_allclose(right.position - left.position, 0.064 * eye.axes[0], atol=1e-12)
        np.testing.assert_allclose((right.position + left.position) / 2, eye.position)
        for one in (left, right):
            assert (one.yaw_deg, one.pitch_deg) == (eye.yaw_deg, eye.pitch_deg)
            assert one.fov_y_deg == eye.fov_y_deg


@pytest.mark.gl
def test_each_half_is_what_its_eye_sees() -> None:
    check_two_eyes(world_of((bush(), herb()), Garden([plants(FEET, [0, 0, 1])]), EYE))


def card_at(away_m: float, eye: Eye) -> World:
    """A card of a twentieth of its distance, straight ahead."""
    card = species_of("card", cards([0, 0, 0], 0.05 * away_m, OPAQUE, [0, 0, 1]))
    feet = eye.position - [0.0, 0.0, away_m]
    return world_of((card,), Garden([plants([[0, 0, 0]], origin=feet)]), eye)


def middle_of(half: np.ndarray) -> float:
    """Pixels: where what is not sky is, from the left, each pixel by how little of it is sky."""
    behind = 255 * srgb_from_linear(np.array(SKY))
    weight = np.abs(half.astype(float) - behind).sum(axis=2)
    weight[weight < 6] = 0.0
    return float((weight.sum(axis=0) * (np.arange(half.shape[1]) + 0.5)).sum() / weight.sum())


@pytest.mark.gl
@pytest.mark.parametrize("away_m", [0.6, 2.0, 8.0])
def test_what_is_near_is_seen_at_places_apart(away_m: float) -> None:
    """By the focal length times 64 mm over the distance, further left by the right eye."""
    eye = Eye(np.array([2.0, 1.0, 3.0]))
    size = (400, 240)
    show = show_of(card_at(away_m, eye), PreviewOptions(stereo=True))
    with loaded(show) as screen:
        (picture,) = frames(show, screen, size, [eye], 30.0)
    left, right = middle_of(picture[:, :200]), middle_of(picture[:, 200:])
    wanted = eye.focal_px(240) * 0.064 / away_m
    assert left - right == pytest.approx(wanted, abs=0.4)  # of a pixel: four samples in each
    assert (left + right) / 2 == pytest.approx(100.0, abs=0.4)


@pytest.mark.gl
def test_in_any_size() -> None:
    """Of an odd width, the right eye has a column less; of a single one, none."""
    show = Show(world_of((herb(),), Garden([plants([[0, 0, 0]])]), EYE), State(Fly(EYE)))
    show.state = replace(show.state, stereo=True)
    eye = Eye(np.array([0.1, 0.2, 0.8]))
    with loaded(show) as screen:
        (even,) = frames(show, screen, (62, 40), [eye], 30.0)
        (odd,) = frames(show, screen, (61, 40), [eye], 30.0)
        for size in ((1, 1), (2, 5), (3, 300)):
            (small,) = frames(show, screen, size, [eye], 30.0)
            assert small.shape == (size[1], size[0], 3)
    np.testing.assert_array_equal(odd, even[:, :61])


# -- what is told ----------------------------------------------------------------------------------


def figures_of(draws: int, said: str, **seconds: float) -> FrameStats:
    return FrameStats(draws, draws, 9, draws, draws, draws, draws, 0.5, seconds, (said,))


def test_figures_are_of_both_eyes() -> None:
    """What is drawn and the time it takes twice; plants are there once."""
    both = of_both(figures_of(3, "a", choose=0.1, draw=0.5), figures_of(4, "b", choose=0.2))
    assert (both.tiles, both.plants, both.total) == (4, 4, 9)
    assert (both.rows, both.draws, both.triangles, both.fragments) == (7, 7, 7, 7)
    assert both.seconds == pytest.approx({"choose": 0.3, "draw": 0.5})
    assert both.said == ("left eye: a", "right eye: b") and both.detail == 0.5


def test_m_compares_nothing_in_stereo() -> None:
    state = State(Fly(EYE), stereo=True)
    assert pressed(state, "m") is state
    with pytest.raises(ValueError, match="compare or stereo"):
        replace(state, compare=True)


# -- surfels ---------------------------------------------------------------------------------------


class Surfels(World):
    """A place that says that there are surfels in it."""

    progressive = True


class Looks(Show):
    """Remembers how each picture was to be drawn."""

    looks: list[Look]

    def __init__(self, world: World, state: State) -> None:
        super().__init__(world, state)
        self.looks = []
        draw = self.forest.draw

        def told(eye: Eye, size: tuple[int, int], look: Look) -> FrameStats:
            self.looks.append(look)
            return draw(eye, size, look)

        self.forest.draw = told  # type: ignore[method-assign, assignment]


@pytest.fixture
def surfels() -> World:
    plain = world_of((herb(),), Garden([plants([[0, 0, 0]])]), Eye(np.array([0.1, 0.3, 1.2])))
    return Surfels(**{name: getattr(plain, name) for name in plain.__dataclass_fields__})


def test_a_rate_is_held_by_the_size_of_surfels_where_there_are_some(surfels: World) -> None:
    """And by distances where there are none. Both are to be within a tenth of what is asked."""
    held = show_of(surfels, PreviewOptions(fps=20.0)).state.governor
    assert held == SizeControl(1000 / 20 / 1.1, LARGEST_PX)
    without = world_of((herb(),), Garden([plants([[0, 0, 0]])]), EYE)
    assert isinstance(show_of(without, PreviewOptions(fps=20.0)).state.governor, Governor)
    assert show_of(surfels, PreviewOptions()).state.governor is None


@pytest.mark.parametrize(
    ("state", "size_px", "detail"),
    [(State(Fly(EYE)), 1.0, 1.0), (State(Fly(EYE), detail=0.25), 4.0, 0.25),
     (State(Fly(EYE), detail=1 / 100), 8.0, 1 / 100), (State(Fly(EYE), detail=3.0), 1.0, 3.0),
     (State(Fly(EYE), governor=SizeControl(10.0, 2.0)), 2.0, 0.5)],
)  # fmt: skip
def test_surfels_are_as_large_as_distances_ask_for(
    state: State, size_px: float, detail: float
) -> None:
    assert (state.surfel_px, state.distances) == (size_px, detail)


def test_the_hand_takes_over_at_the_size_that_there_is() -> None:
    state = pressed(State(Fly(EYE), governor=SizeControl(10.0, 4.0)), "minus")
    assert state.governor is None and state.surfel_px == pytest.approx(4.4)


@pytest.mark.gl
def test_the_size_is_found_and_told(surfels: World) -> None:
    """There is time enough: from eight pixels down to one, by a quarter a step."""
    show = show_of(surfels, PreviewOptions(fps=1e-3))
    with loaded(show) as screen:
        settle(show, screen, (60, 40), surfels.start)
        held = show.state.governor
        assert isinstance(held, SizeControl) and held.size_px == 1.0 and held.resting
        assert "holding 0.001 fps" in show.overlay()
        assert "surfels of 1.00 pixels" in show.overlay()
        # and there is none
        show.state = replace(show.state, governor=SizeControl(1e-6))
        assert show.moves()
        sizes = []
        for _ in range(2 * (LATE_FRAMES + MEDIAN_FRAMES)):
            timed_frames(show, screen, (60, 40), [surfels.start], 30.0)
            sizes.append(show.state.surfel_px)
    assert sizes == [1.0] * (LATE_FRAMES + MEDIAN_FRAMES - 1) + [8.0] * (len(sizes) - 5)
    assert SETTLING > 8 * (LATE_FRAMES + MEDIAN_FRAMES), "steps from 8 pixels down to one"


@pytest.mark.gl
def test_each_picture_is_told_the_size_and_where_it_may_be_larger(
    surfels: World,
) -> None:
    """In stereo towards the border; in full, compared, nowhere."""
    show = Looks(surfels, State(Fly(surfels.start)))
    with loaded(show) as screen:
        for changes, wanted in (
            ({"governor": SizeControl(10.0, 4.0)}, [(4.0, None, 0.25)]),
            ({"stereo": True, "detail": 0.5}, [(2.0, Fovea(), 0.5)] * 2),
            ({"compare": True, "detail": 0.5}, [(2.0, None, 0.5), (1.0, None, 1e9)]),
        ):
            show.state = replace(State(Fly(surfels.start)), **changes)  # type: ignore[arg-type]
            show.looks.clear()
            timed_frames(show, screen, (60, 40), [surfels.start], 30.0)
            found = [(look.surfel_px, look.fovea, look.detail) for look in show.looks]
            assert found == wanted
            lines = show.overlay().splitlines()
            assert (" | ".join(EYES) in lines) == ("stereo" in changes)
            assert (" | ".join(PANELS) in lines) == ("compare" in changes)
