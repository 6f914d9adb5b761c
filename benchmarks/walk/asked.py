"""What is asked of a walk, and what of it is missed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from walk.scenes import SETTINGS
from walk.speed import LEVELS, Walked
from walk.transition import Changes

GPU_FPS = 100.0
PEAK_MB = 2000
COVERAGE, RATIO = 0.05, 1.5


def missed_of_speed(found: Sequence[Walked], software: bool) -> Iterator[str]:
    """Frames per second and plants where the asked rate is held, and memory wherever levels are."""
    for walked in found:
        if walked.walk.drawn != LEVELS:
            continue
        setting = SETTINGS[walked.walk.scene]
        where = f"speed: {setting.name}, {walked.walk.name}"
        if walked.peak_mb > PEAK_MB:
            yield f"{where}: {walked.peak_mb:,} MB, at most {PEAK_MB:,}"
        if walked.walk.fps != setting.fps:
            continue
        least = setting.fps if software else GPU_FPS
        if walked.fps < least:
            yield f"{where}: median {walked.fps:.2f} frames per second, at least {least:g}"
        if walked.plants < setting.displayed:
            yield f"{where}: {walked.plants:,} plants, at least {setting.displayed:,}"


def missed_of_transition(found: Sequence[Changes]) -> Iterator[str]:
    """Coverage and changes of every plant, all its transitions together, as levels fade unless
    told otherwise."""
    for library, species in dict.fromkeys((c.library, c.species) for c in found):
        some = [
            c for c in found
            if (c.library, c.species, c.fade) == (library, species, "alpha-test")
        ]  # fmt: skip
        where = f"transition: {library} {species}"
        worst = max(some, key=lambda c: abs(c.coverage - 1))
        if abs(worst.coverage - 1) > COVERAGE:
            off = f"{worst.coverage - 1:+.1%} at LOD{worst.transition.level}"
            yield f"{where}: coverage {off}, at most {COVERAGE:.0%}"
        ratios = np.concatenate([c.ratios for c in some])
        if (above := int((ratios > RATIO).sum())) > 0:
            most = f"up to {ratios.max():.2f}, at most {RATIO:g}"
            yield f"{where}: {above} of {len(ratios)} pairs change more than the truth: {most}"
