"""What holds of a stereo picture of any place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from vegtool.preview.drawn import show_of
from vegtool.preview.options import PreviewOptions
from vegtool.preview.run import frames, loaded
from vegtool.preview.scenery import Place
from vegtool.preview.show import EYES_APART_M

SIZE = (120, 80)


def check_two_eyes(place: Place) -> None:
    """Each half, to the bit, is the picture of half the width from 32 mm beside, and they differ.

    Where there are no surfels, that is: where there are, the middle is finer.
    """
    half = SIZE[0] // 2
    aside = EYES_APART_M / 2 * place.start.axes[0]
    eyes = [replace(place.start, position=place.start.position + way * aside) for way in (-1, 1)]
    show = show_of(place, PreviewOptions())
    with loaded(show) as screen:
        left, right = frames(show, screen, (half, SIZE[1]), eyes, 30.0)
        show.state = replace(show.state, stereo=True)
        (picture,) = frames(show, screen, SIZE, [place.start], 30.0)
    np.testing.assert_array_equal(picture[:, :half], left)
    np.testing.assert_array_equal(picture[:, half:], right)
    assert (left != right).any() and left.std() > 10
