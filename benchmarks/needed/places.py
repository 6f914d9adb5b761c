"""Four scenes whose viewers cannot see everything: a road, a flight, a backdrop, a wood.

Plants are samples of vegtool, placed by rules or by an inventory made here; each scene is a folder
with its files.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vegtool.seeding import generator

MODELS = {
    "broadleaf": (20_000, (8.0, 14.0)),
    "conifer": (20_000, (10.0, 18.0)),
    "bush": (10_000, (1.0, 2.2)),
    "herb": (6_000, (0.3, 0.7)),
    "grass-clump": (4_000, (0.25, 0.55)),
}
"""Triangles of each sample, and heights in metres."""
STRIP_M = (240.0, 60.0)
"""A backdrop: its length, and its depth."""
BESIDE = (("broadleaf", 2500, 8.0), ("conifer", 2000, 8.0), ("bush", 4000, 4.0))
"""A road: how many of each, and metres from its middle within which none stands."""
BACKDROP_M = 180.0
"""From the terrace to the nearest plant of the backdrop."""


@dataclass(frozen=True)
class Place:
    """A scene, and what it is asked of its output: at most such a share of the bytes of what is
    made without it. write: its files into a folder; returns the scene file. prelit: light is baked
    in both."""

    name: str
    share: float
    write: Callable[[Path], Path]
    prelit: bool = False


def _scene(folder: Path, camera: str, rest: str, kinds: dict[str, float]) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    lines = [f"[camera]\n{camera}", rest]
    for name, share in kinds.items():
        low, high = MODELS[name][1]
        lines.append(f'[[species]]\nname = "{name}"\nshare = {share}\nheight_m = [{low}, {high}]')
    path = folder / "scene.toml"
    path.write_text("\n\n".join(lines) + "\n", encoding="utf-8")
    return path


def road(folder: Path) -> Path:
    """Along the middle of 600 x 600 m, at eye height, the sun fixed; nothing grows on the road."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "way.toml").write_text(
        "".join(f"[[station]]\nposition = [{x}, 0]\nyaw_deg = -90\n\n" for x in (-290, 290)),
        encoding="utf-8",
    )
    rest = (
        "[light]\nmoves = false\nsun = [135, 40]\n\n"
        '[terrain]\nkind = "plane"\nextent_m = [600, 600]\n\n'
        '[placement]\nseed = 1\ninventory = "trees.csv"'
    )
    random = generator(1, "road")
    rows = ["x,y,species,height"]
    for name, count, clear in (
        ("broadleaf", 2500, 8.0),
        ("conifer", 2000, 8.0),
        ("bush", 4000, 4.0),
    ):
        xy = random.uniform(-300, 300, (3 * count, 2))
        xy = xy[np.abs(xy[:, 1]) > clear][:count]
        low, high = MODELS[name][1]
        rows += [
            f"{x:.2f},{y:.2f},{name},{h:.2f}"
            for (x, y), h in zip(xy, random.uniform(low, high, len(xy)), strict=True)
        ]
    (folder / "trees.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    camera = 'path = "way.toml"\nheight_m = [1.5, 1.8]\nmargin_m = 1.5'
    return _scene(folder, camera, rest, dict.fromkeys(("broadleaf", "conifer", "bush"), 1.0))


def flight(folder: Path) -> Path:
    """A drone, 60 to 100 m above a wood of 300 x 300 m."""
    camera = "polygon = [[-150, -150], [150, -150], [150, 150], [-150, 150]]\nheight_m = [60, 100]"
    rest = (
        '[light]\nmoves = true\n\n[terrain]\nkind = "plane"\nextent_m = [300, 300]\n\n'
        "[placement]\nseed = 1\nspacing_m = 3.0"
    )
    kinds = {"broadleaf": 0.35, "conifer": 0.3, "bush": 0.35}
    return _scene(folder, camera, rest, kinds)


def backdrop(folder: Path) -> Path:
    """A wood's edge, seen from a terrace 180 m away; its plants are turned as they stand."""
    folder.mkdir(parents=True, exist_ok=True)
    random = generator(2, "backdrop")
    rows = ["x,y,species,height,rotation"]
    for name, count in (("broadleaf", 350), ("conifer", 300), ("bush", 500)):
        x = random.uniform(-STRIP_M[0] / 2, STRIP_M[0] / 2, count)
        y = BACKDROP_M + random.uniform(0, STRIP_M[1], count)
        low, high = MODELS[name][1]
        rows += [
            f"{a:.2f},{b:.2f},{name},{h:.2f},0"
            for a, b, h in zip(x, y, random.uniform(low, high, count), strict=True)
        ]
    (folder / "trees.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    camera = "polygon = [[-15, -5], [15, -5], [15, 5], [-15, 5]]\nheight_m = [1.5, 1.8]"
    rest = (
        '[light]\nmoves = false\nsun = [30, 35]\n\n[terrain]\nkind = "plane"\n'
        'extent_m = [600, 600]\n\n[placement]\nseed = 1\ninventory = "trees.csv"'
    )
    return _scene(folder, camera, rest, dict.fromkeys(("broadleaf", "conifer", "bush"), 1.0))


def wood(folder: Path) -> Path:
    """Anywhere in a wood of 120 x 120 m, on foot."""
    camera = "polygon = [[-60, -60], [60, -60], [60, 60], [-60, 60]]\nheight_m = [1.5, 1.8]"
    rest = (
        '[light]\nmoves = true\n\n[terrain]\nkind = "plane"\nextent_m = [120, 120]\n\n'
        "[placement]\nseed = 1\nspacing_m = 1.2"
    )
    kinds = {"broadleaf": 0.05, "conifer": 0.04, "bush": 0.11, "herb": 0.3, "grass-clump": 0.5}
    return _scene(folder, camera, rest, kinds)


PLACES = {
    place.name: place
    for place in (
        Place("road", 0.15, road, prelit=True),
        Place("flight", 0.50, flight),
        Place("backdrop", 0.10, backdrop, prelit=True),
        Place("wood", 0.60, wood),
    )
}
