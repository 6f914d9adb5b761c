"""Volumes and time of the boxes, against trimesh's and against a dense search, on real plants.

    python benchmarks/boxes.py MODEL... [--counts 64,256] [--row]

Per plant and count, over all clusters (k-means on positions), in percent, no side of any box taken
shorter than a thousandth of its cluster's diagonal:
trimesh_median, trimesh_p95  excess of our volume over that of trimesh.bounds.oriented_bounds
dense_median, dense_p95      excess over the least box of a dense search with many starts, below
seconds, trimesh_seconds     processor time of one call for all clusters (least of three), and of
                             one call per cluster, on the same points; faster is their ratio
`--row` appends the rows to benchmarks/results/boxes.csv.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
from recorded import record
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from vegtool import __version__
from vegtool.arrays import FloatArray
from vegtool.boxes import fit_boxes
from vegtool.boxes.box import MIN_EXTENT
from vegtool.clustering import ClusterOptions, cluster
from vegtool.formats import read_plant

STARTS, FOLLOWED = 3000, 40


def dense_volume(points: FloatArray, floor: float) -> float:
    """Least volume from 3,000 starts all over the rotations, the best 40 refined to 0.1 degree."""
    points = points - points.mean(axis=0)
    with contextlib.suppress(QhullError):  # flat or line-like: all points it is
        points = points[ConvexHull(points).vertices]

    def volumes(turns: FloatArray) -> FloatArray:
        extent = np.ptp(turns @ points.T, axis=2)
        return np.asarray(np.maximum(extent, floor).prod(axis=1))

    starts = Rotation.random(STARTS, rng=np.random.default_rng(0)).as_matrix()
    best = starts[np.argsort(volumes(starts))[:FOLLOWED]]
    least = volumes(best)
    steps = np.array([[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)])
    for degrees in (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.1):
        near = Rotation.from_rotvec(steps * np.radians(degrees)).as_matrix()
        for _ in range(40):
            tried = np.einsum("rij,sjk->srik", near, best)
            found = volumes(tried.reshape(-1, 3, 3)).reshape(len(best), -1)
            which = found.argmin(axis=1)
            row = np.arange(len(best))
            better = found[row, which] < least * (1 - 1e-9)
            if not better.any():
                break
            best[better] = tried[row, which][better]
            least[better] = found[row, which][better]
    return float(least.min())


def rows(models: list[Path], counts: list[int]) -> Iterator[dict[str, object]]:
    """One row per plant and count."""
    for path in models:
        plant = read_plant(path)
        for count in counts:
            labels = cluster(plant, "kmeans", count, ClusterOptions(orientation_weight=0.0))
            # The vertices of each cluster, once each: the same points for both.
            pair = np.unique(np.stack([np.repeat(labels, 3), plant.faces.ravel()]), axis=1)
            member, points = pair[0].astype(np.int32), plant.positions[pair[1]]
            seconds = []
            for _ in range(3):
                start = time.process_time()
                boxes = fit_boxes(points, member, count)
                seconds.append(time.process_time() - start)
            each = [points[member == k] for k in range(count)]
            diagonal = [2 * np.linalg.norm(p - p.mean(axis=0), axis=1).max() for p in each]
            floor = MIN_EXTENT * np.array(diagonal)
            start = time.process_time()
            theirs = np.stack([trimesh.bounds.oriented_bounds(p)[1] for p in each])
            trimesh_seconds = time.process_time() - start
            dense = [dense_volume(p, f) for p, f in zip(each, floor, strict=True)]
            ours = boxes.volume(floor)
            over = 100 * (ours / np.maximum(theirs, floor[:, None]).prod(axis=1) - 1)
            worse = 100 * (ours / np.array(dense) - 1)
            yield {
                "version": __version__,
                "plant": path.stem,
                "clusters": count,
                "points": len(points),
                "trimesh_median": f"{np.median(over):.2f}",
                "trimesh_p95": f"{np.quantile(over, 0.95):.2f}",
                "dense_median": f"{np.median(worse):.2f}",
                "dense_p95": f"{np.quantile(worse, 0.95):.2f}",
                "seconds": f"{min(seconds):.3f}",
                "trimesh_seconds": f"{trimesh_seconds:.3f}",
                "faster": f"{trimesh_seconds / min(seconds):.1f}",
            }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="+", type=Path)
    parser.add_argument("--counts", default="64,256")
    parser.add_argument("--row", action="store_true")
    args = parser.parse_args()
    written: list[dict[str, object]] = []
    for row in rows(args.models, [int(c) for c in args.counts.split(",")]):
        if not written:
            print("  ".join(f"{name:>15}" for name in row))
        print("  ".join(f"{value!s:>15}" for value in row.values()), flush=True)
        written.append(row)
    if args.row and written:
        record("boxes", written)


if __name__ == "__main__":
    main()
