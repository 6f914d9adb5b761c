"""The parameter files: samples/species/NAME.toml, read into frozen dataclasses.

The keys of a file are the fields below; docs/samples.md explains them with pictures. Parameters
follow the idea of J. Weber, J. Penn, "Creation and rendering of realistic trees", SIGGRAPH 1995:
a few numbers per branching level (length, taper, curve, down angle, rotation) and an envelope.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from vegtool.errors import CapabilityError, InputError


@dataclass(frozen=True)
class StemLevel:
    """The stems of one branching level; angles in degrees."""

    count: int
    """Stems of this level on the whole plant."""
    length: float
    """Metres for level 0, else a share of the parent's length."""
    radius: float
    """At the base: metres for level 0, else a share of the parent's where it leaves it."""
    length_variation: float = 0.15
    taper: float = 0.9
    """0 is a cylinder, 1 a cone."""
    along: tuple[float, float] = (0.2, 1.0)
    """Where on the parent these stems start, as shares of its length."""
    envelope: tuple[float, ...] = (1.0,)
    """Relative length, evenly spaced from the lowest to the highest place on the parent."""
    down_angle: tuple[float, float] = (50.0, 40.0)
    """Angle to the parent for the lowest and the highest of them."""
    down_variation: float = 8.0
    rows: int = 0
    """0: spiral by the golden angle; 2: alternating left and right of the parent."""
    row_variation: float = 20.0
    curve: float = 0.0
    """Bend from base to tip; positive is upward."""
    wander: float = 25.0
    """Random bend along the stem."""
    tropism: float = 0.0
    """Pull upward (positive) or downward by the end of the stem, 1 is strong."""
    spread: float = 0.0
    """Level 0: radius in metres of the patch from which the stems rise."""
    sides: float = 0.0
    """Sides of the tube at reference detail; 0: no wood (the stem only carries leaves)."""
    segments: float = 4.0
    """Rings of the tube at reference detail."""


@dataclass(frozen=True)
class Foliage:
    """Leaves, or cards that show several; angles in degrees."""

    count: int
    """At reference detail; fewer are larger so that the crown covers as much."""
    length: float
    """Metres, of one card or leaf at reference detail."""
    width: float
    """Metres."""
    texture: str
    """Which drawing of textures.py: broad, blossom or needle twig, leaf, flower, blade."""
    levels: tuple[int, ...] = ()
    """Branching levels that carry it; none given: the last."""
    along: tuple[float, float] = (0.1, 1.0)
    envelope: tuple[float, ...] = (1.0,)
    length_variation: float = 0.2
    down_angle: tuple[float, float] = (55.0, 10.0)
    down_variation: float = 15.0
    rows: int = 0
    row_variation: float = 30.0
    roll_variation: float = 40.0
    """How far a leaf turns about its own axis, away from facing the sky."""
    droop: float = 15.0
    """Bend downward from base to tip."""
    segments: int = 1
    pointed: bool = False
    """A blade that ends in one point; it keeps its length at any detail, its width varies."""
    colors: tuple[str, ...] = ("#31561e", "#6d8f36", "#a3ad62")
    """Dark, light, and midrib (or heart of the flower)."""
    leaves: int = 7
    """How many leaves the drawing shows."""
    slimness: float = 0.45
    """Width of the drawn leaf as a share of its length."""
    teeth: int = 0
    """Teeth on each edge of the drawn leaf."""


@dataclass(frozen=True)
class Bark:
    """The procedural bark."""

    tile: float = 0.6
    """Metres that one repeat of the texture spans around the stem."""
    colors: tuple[str, str] = ("#2e251d", "#85705a")
    """In the furrows and on the ridges."""
    stretch: float = 4.0
    """How much longer than wide the furrows are; below 1 they run around the stem."""
    relief: float = 1.0


@dataclass(frozen=True)
class Species:
    """One parameter file."""

    triangles: int
    """At reference detail, and by default."""
    wood_share: float
    """Share of the triangles that is spent on wood."""
    bark: Bark
    stems: tuple[StemLevel, ...]
    foliage: tuple[Foliage, ...] = ()
    flare: float = 0.0
    """How much wider the trunk is at the ground, as a share of its radius."""


def read_species(name: str) -> Species:
    """The parameters of a sample, from the installed package or from the checkout."""
    package = Path(__file__).parent.parent
    for folder in (package / "species", package.parent / "samples" / "species"):
        path = folder / f"{name}.toml"
        if path.is_file():
            return parse_species(path.read_text(encoding="utf-8"), str(path))
    raise CapabilityError(
        f"The parameters of the sample '{name}' ({name}.toml) are not installed beside vegtool "
        f"in {package / 'species'}. Install vegtool again."
    )


def parse_species(text: str, source: str) -> Species:
    """The parameters written in `text`; `source` names it in messages."""
    try:
        values = tomllib.loads(text)
        values["stems"] = tuple(_build(StemLevel, entry) for entry in values.get("stems", ()))
        values["foliage"] = tuple(_build(Foliage, entry) for entry in values.get("foliage", ()))
        values["bark"] = _build(Bark, values.get("bark", {}))
        species: Species = _build(Species, values)
        return species
    except (tomllib.TOMLDecodeError, TypeError, ValueError) as error:
        raise InputError(f"{source}: not a species file: {error}") from error


def _build(kind: type[Any], values: dict[str, Any]) -> Any:
    known = {field.name for field in fields(kind)}
    unknown = sorted(set(values) - known)
    if unknown:
        raise ValueError(f"unknown key '{unknown[0]}'; known are {', '.join(sorted(known))}")
    return kind(**{k: tuple(v) if isinstance(v, list) else v for k, v in values.items()})
