"""ISODATA for long and thin clusters.

After Ball and Hall, "ISODATA, a novel method of data analysis and pattern classification" (1965),
in the variant that Colditz et al. (2005, section 2) name but do not spell out: "clusters are
dynamically split or merged due to their size. We modified this approach in order to get mostly
long and thin clusters instead of the compact forms." Our reading:

clusters are lines, and the length of a line counts 1 / elongation as much as its width wherever
points move, clusters split or clusters merge (`clustering/lines.py`).

Ball and Hall's thresholds on size become ranks, since the count is given: every round splits the
costliest clusters and merges the cheapest pairs, all of the count at first, nothing in the last
round. So it always ends, however split and merge may undo each other.
"""

from __future__ import annotations

import numpy as np

from vegtool.arrays import IntArray
from vegtool.clustering import ClusterOptions
from vegtool.clustering.features import coarse, samples
from vegtool.clustering.lines import settle_lines
from vegtool.plant import Plant
from vegtool.progress import Progress


def isodata(
    plant: Plant, count: int, options: ClusterOptions, seed: int, progress: Progress
) -> IntArray:
    """(f,) int32 labels of at most `count` long and thin clusters. No random choice is made."""
    few = coarse(samples(plant, options.line_scale(count), count), count)
    start = np.zeros(len(few.points), dtype=np.int64)
    labels = settle_lines(few, start, count, options.elongation, progress=progress)
    return np.asarray(labels[few.of_face], dtype=np.int32)
