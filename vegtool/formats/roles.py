"""Which materials are leaves and which are wood.

In this order: the user's patterns, the material's name, the names of what wears it, its alpha mask,
its colour, and last its shape: cards have fewer faces than points, tubes about two per point.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from fnmatch import fnmatchcase

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.errors import UsageError
from vegtool.plant import Material, Role
from vegtool.srgb import linear_from_srgb

LEAF_WORDS = re.compile(
    r"lea[fv](?!less)|foliage|needle|frond|petal|flower|blossom|canopy|grass|fern|"
    r"(?<![a-z])(?:blades?|crown|bloom|buds?)(?![a-z])"
)
WOOD_WORDS = re.compile(
    r"bark|wood|trunk|branch|stem|(?<![a-z])(?:stump|roots?|logs?|bole|stalks?|culm)(?![a-z])"
)
GREENNESS = 1.08
"""Green at least this many times red and blue (linear) is a leaf's colour."""
CARD_FACES_PER_POINT = 0.95
"""Below: cards (0.5 for a quad) and blades; from 1 up: tubes (2, or 1 for a single segment)."""


def role_from_name(name: str) -> Role | None:
    """leaf or wood where the name has words for exactly one of them."""
    text = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name).lower()
    leaf, wood = bool(LEAF_WORDS.search(text)), bool(WOOD_WORDS.search(text))
    if leaf == wood:
        return None
    return "leaf" if leaf else "wood"


def guess_role(material: Material, wearers: set[str], faces_per_point: Callable[[], float]) -> Role:
    """The role of a material worn by parts of these names; its shape is asked for last."""
    by_name = role_from_name(material.name)
    if by_name:
        return by_name
    named = {role_from_name(name) for name in wearers} - {None}
    if len(named) == 1:
        (role,) = named
        assert role is not None
        return role
    if material.alpha_mode == "mask":
        return "leaf"
    red, green, blue = mean_color(material)
    if green > GREENNESS * max(red, blue):
        return "leaf"
    return "leaf" if faces_per_point() < CARD_FACES_PER_POINT else "wood"


def named_roles(materials: list[Material], patterns: tuple[str, ...], source: str) -> list[Role]:
    """Roles by the user's patterns; UsageError where a pattern fits no material."""
    names = [m.name.casefold() for m in materials]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern.casefold()) for name in names):
            raise UsageError(
                f"--leaf-material: expected one of {source}'s materials "
                f"({', '.join(m.name for m in materials)}), found {pattern!r}"
            )
    return [
        "leaf" if any(fnmatchcase(name, p.casefold()) for p in patterns) else "wood"
        for name in names
    ]


def mean_color(material: Material) -> FloatArray:
    """(3,) linear: mean colour of the visible texels, times the base colour."""
    color = np.ones(3)
    if material.color_texture is not None:
        step = max(1, max(material.color_texture.pixels.shape[:2]) // 64)
        texels = material.color_texture.pixels[::step, ::step].reshape(-1, 4)
        visible = texels[texels[:, 3] >= 128]
        if len(visible):
            color = linear_from_srgb(visible[:, :3] / 255.0).mean(axis=0)
    return np.asarray(color * material.base_color[:3])
