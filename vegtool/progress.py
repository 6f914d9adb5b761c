"""How operations report progress: one callback, which the command line turns into a bar."""

from __future__ import annotations

from collections.abc import Callable

Progress = Callable[[str, float], None]
"""Called with the name of the stage and the fraction done, 0 to 1."""


def silent(stage: str, fraction: float) -> None:
    """The default: report nothing."""


def part_of(progress: Progress, before: float, share: float) -> Progress:
    """What reports a part: so much is done before it, and so large it is, of 0 to 1."""
    return lambda stage, fraction: progress(stage, before + share * fraction)
