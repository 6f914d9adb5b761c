"""How flat, how well turned and how full the clusters of each method are, at equal budget.

    python benchmarks/clustering.py MODEL... [--counts 600,67] [--methods kmeans,...] [--row]

Per plant, method and count, all weighted by area, about each cluster's oriented plane:
thick   RMS distance of surface from its plane, in thousandths of the plant's radius
facing  mean |cosine| between face and plane normal (1: every face lies along its plane)
tilted  RMS of that angle's sine: thick and tilted are the two ways in which a plane is wrong
long    median ratio of a cluster's first to second principal standard deviation
fill    projected area of all faces over the rectangles' area (above 1: faces lie over each other)
seconds of the processor, median of three
`--row` appends the rows to benchmarks/results/clustering.csv.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from recorded import record

from vegtool.arrays import IntArray, unit
from vegtool.boxes import oriented_planes
from vegtool.clustering import METHODS, ClusterOptions, cluster
from vegtool.formats import read_plant
from vegtool.plant import Plant


def quality(plant: Plant, labels: IntArray) -> dict[str, float]:
    """The columns of the table, for one partition."""
    k = int(labels.max()) + 1
    boxes = oriented_planes(plant.corners, labels, k)
    share = plant.face_areas / plant.face_areas.sum()
    normal = boxes.axes[labels, 2]
    mass = np.maximum(np.bincount(labels, share, k), 1e-300)
    local = plant.corners - plant.center

    def mean(values: np.ndarray) -> np.ndarray:
        return np.bincount(labels, share * values, k) / mass

    center = np.stack([mean(local.mean(axis=1)[:, i]) for i in range(3)], axis=1)
    offset = local - center[labels][:, None]
    height = np.einsum("fci,fi->fc", offset, normal)
    thick = (height**2).sum(axis=1) + height.sum(axis=1) ** 2  # a triangle's second moment x 12
    cosine = np.abs(np.einsum("fi,fi->f", unit(plant.face_area_vectors), normal))
    moments = np.empty((k, 3, 3))
    for i in range(3):
        for j in range(3):
            product = (offset[:, :, i] * offset[:, :, j]).sum(axis=1)
            moments[:, i, j] = mean(product + offset[:, :, i].sum(1) * offset[:, :, j].sum(1))
    spread = np.sqrt(np.maximum(np.linalg.eigvalsh(moments), 0))
    solid = spread[:, 1] > 1e-6 * plant.radius
    rectangles = 4 * boxes.half[:, 0] * boxes.half[:, 1]
    return {
        "clusters": k,
        "thick": 1e3 * float(np.sqrt((share * thick).sum() / 12)) / plant.radius,
        "facing": float((share * cosine).sum()),
        "tilted": float(np.sqrt((share * (1 - np.minimum(cosine, 1) ** 2)).sum())),
        "long": float(np.median(spread[solid, 2] / spread[solid, 1])) if solid.any() else 1.0,
        "fill": float((plant.face_areas * cosine).sum() / max(rectangles.sum(), 1e-300)),
    }


def rows(
    models: list[Path], counts: list[int], methods: list[str], weight: float
) -> Iterator[dict[str, object]]:
    """One row per plant, count and method."""
    for path in models:
        plant = read_plant(path)
        for count in counts:
            for method in methods:
                options = ClusterOptions(orientation_weight=weight)
                times = []
                for _ in range(3):
                    start = time.process_time()
                    labels = cluster(plant, method, count, options)
                    times.append(time.process_time() - start)
                yield {
                    "plant": path.stem,
                    "faces": len(plant.faces),
                    "count": count,
                    "method": method,
                    "weight": weight,
                    **quality(plant, labels),
                    "seconds": statistics.median(times),
                }


def shown(value: object) -> str:
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("models", nargs="+", type=Path)
    parser.add_argument("--counts", default="600,67")
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--weight", type=float, default=ClusterOptions().orientation_weight)
    parser.add_argument("--row", action="store_true")
    args = parser.parse_args()
    counts = [int(c) for c in args.counts.split(",")]
    written: list[dict[str, object]] = []
    for row in rows(args.models, counts, args.methods.split(","), args.weight):
        if not written:
            print("  ".join(f"{name:>9}" for name in row))
        print("  ".join(f"{shown(value):>9}" for value in row.values()), flush=True)
        written.append(row)
    if args.row and written:
        record("clustering", [{n: shown(v) for n, v in row.items()} for row in written])


if __name__ == "__main__":
    main()
