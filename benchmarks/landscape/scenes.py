"""The landscapes that are made into tiles, and the plants in them: ten species, made by script.

All are flat, with as many plants to the square metre as the paper's 390,000 on a square kilometre.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from vegtool.cli import run
from vegtool.formats.gltf import plant_glb
from vegtool.growth import sample
from vegtool.tiles.blue_noise import COUNT
from vegtool.tiles.pattern import least_distance

PLANTS, SIDE_M = 390_000, 1000.0
"""Colditz et al. 2005, introduction."""
LEVELS = 9
SEED = 1
Say = Callable[[str], None]


@dataclass(frozen=True)
class Kind:
    """A species: the sample that it is and its individual. share: of all plants. height_m: smallest
    and tallest."""

    sample: str
    seed: int
    share: float
    height_m: tuple[float, float]

    @property
    def name(self) -> str:
        """Of its files."""
        return f"{self.sample}-{self.seed + 1}"


KINDS = tuple(
    Kind(name, seed, share / 2, height)
    for name, share, height in (
        ("broadleaf", 0.06, (6.0, 14.0)),
        ("conifer", 0.05, (8.0, 18.0)),
        ("bush", 0.20, (1.0, 2.2)),
        ("herb", 0.30, (0.3, 0.7)),
        ("grass-clump", 0.39, (0.25, 0.55)),
    )
    for seed in (0, 1)
)
"""Ten species: two individuals of each sample, as in the forest of benchmarks/preview.py."""


def library(cache: Path, say: Say) -> Path:
    """The folder of these plants, converted where that was not done before."""
    folder = cache / "library"
    wanted = [kind for kind in KINDS if not (folder / f"{kind.name}.lod.json").exists()]
    with TemporaryDirectory() as place:
        files = []
        for kind in wanted:
            files.append(Path(place) / f"{kind.name}.glb")
            files[-1].write_bytes(plant_glb(sample(kind.sample, seed=kind.seed)))
        if files:
            say(f"converting {', '.join(kind.name for kind in wanted)}")
            done = run(
                ["convert", *map(str, files), "-o", str(folder), "--levels", str(LEVELS), "-j", "2",
                 "-q"]
            )  # fmt: skip
            if done:
                raise SystemExit(done)
    return folder


def scene(cache: Path, plants: int, side_m: float | None = None) -> Path:
    """The scene file of a landscape of so many plants, as dense as all, or on so many metres."""
    side = SIDE_M * (plants / PLANTS) ** 0.5 if side_m is None else side_m
    spacing = least_distance() * side * (COUNT / plants) ** 0.5
    lines = [
        f'[terrain]\nkind = "plane"\nextent_m = [{side:.6g}, {side:.6g}]\n',
        f"[placement]\nseed = {SEED}\nspacing_m = {spacing:.9g}\n",
    ]
    for kind in KINDS:
        low, high = kind.height_m
        lines.append(
            f'[[species]]\nname = "{kind.name}"\nshare = {kind.share:g}\n'
            f"height_m = [{low:g}, {high:g}]\n"
        )
    path = cache / f"scene_{plants}_{side:g}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines), encoding="utf-8")
    return path
