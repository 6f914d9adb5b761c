"""Whether levels still cover what the plant does where the next ones begin.

Alpha is solved for the distances that a level is made for (coverage.py). Farther away mips lose
what is covered, and that is where a level ends up if the one after it is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from vegtool.lod import Level
from vegtool.measure.scores import TruthsAt
from vegtool.refine.coverage import measured_bias

KEPT = 0.05
"""Of what the truth covers: the most by which a level may differ."""


def coverage_notes(levels: Sequence[Level], truth_at: TruthsAt) -> tuple[str, ...]:
    """A sentence on each level with an atlas that covers more or less than the plant, by more than
    KEPT, where the next level begins.

    levels: coarser and coarser, used from their `near_distance_m` on. The last, which no other one
    follows, is not asked. Raises CapabilityError where OpenGL cannot draw.
    """
    notes = []
    for level, after in pairwise(levels):
        far_m = after.near_distance_m
        bias = None if level.atlas is None else measured_bias(level, [truth_at(far_m)])
        if bias is not None and abs(bias) > KEPT:
            notes.append(
                f"the level of {level.triangles:,} triangles covers {abs(bias):.0%} "
                f"{'more' if bias > 0 else 'less'} than the plant from {far_m:g} m, up to where "
                "it is used; more --levels may come closer"
            )
    return tuple(notes)
