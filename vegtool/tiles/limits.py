"""What plants that were converted for the eyes of one scene lack for others."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from hashlib import blake2b
from math import inf
from pathlib import Path
from typing import Any

from vegtool.errors import InputError
from vegtool.limits import between
from vegtool.scene import Scene
from vegtool.tiles.library import MadeFor, Species

NEARER = 1e-4
"""Of a distance, or of pixels to the metre: less is rounding."""


def digest_of(scene: Scene) -> str:
    """Of all in a scene that says how its plants are seen: where eyes, ground and plants are, with
    the files that say so. Raises InputError for one that cannot be read."""
    told: dict[str, Any] = {
        "camera": asdict(scene.camera),
        "terrain": asdict(scene.terrain),
        "species": [asdict(one) for one in scene.species],
        "placement": asdict(scene.placement),
        "lit": None if scene.light is None else scene.light.moves,
    }
    named = [scene.camera.path, scene.terrain.heightmap, scene.placement.inventory]
    named += [one.density for one in scene.species]
    digest = blake2b(repr(told).encode(errors="replace"), digest_size=16)
    for name in named:
        digest.update(b"" if name is None else _contents(scene.path.parent / name))
    return digest.hexdigest()


def _contents(path: Path) -> bytes:
    try:
        return blake2b(path.read_bytes()).digest()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); allow it") from error


def lacking(
    one: Species, focal_px: float, nearest_m: float = 0.0, farthest_m: float = inf
) -> list[str]:
    """Sentences on what a species lacks, made for the eyes of a scene, in pictures in which a metre
    at a distance of one is `focal_px` pixels, with eyes from the nearest to the farthest, metres
    divided by the plant's scale."""
    found, made_for = list[str](), one.made_for
    if made_for is None:
        return found
    limits, again = made_for.limits, again_of(made_for)
    own_px = limits.display.pixels_per_metre(1.0)
    if focal_px > own_px * (1 + NEARER):
        shown = limits.display
        found.append(
            f"{made_for.manifest}: was made for pictures of {shown.fov_y_deg:g} degrees and "
            f"{shown.image_height_px} pixels, in which plants are {focal_px / own_px:.3g} times as "
            f"small as here; there are no finer levels for that: {again}"
        )
    near = nearest_m < limits.nearest_m * (1 - NEARER)
    far = farthest_m > limits.farthest_m * (1 + NEARER)
    if near or far:
        where = [*(["nearer"] if near else []), *(["farther"] if far else [])]
        missing = ", ".join(made_for.left_out) or "nothing, but what was reduced"
        seen = between(limits.nearest_m, limits.farthest_m)
        found.append(
            f"{made_for.manifest}: was made for eyes {seen} away, and may be seen from "
            f"{' and '.join(where)} here ({between(nearest_m, farthest_m)}); missing: {missing}; "
            f"{again}"
        )
    return found


def again_of(made_for: MadeFor) -> str:
    """How to get what is missing."""
    folder = made_for.manifest.parent
    return (
        f"vegtool convert MODEL --scene SCENE -o {folder} -f makes it for another scene, without "
        "--scene for any"
    )


def of_any_eye(species: Sequence[Species], focal_px: float, scene: Scene) -> list[str]:
    """The sentences on species where eyes may be anywhere, but in the very scene that they were
    made for."""
    if all(one.made_for is None for one in species):
        return []
    same = digest_of(scene)
    found = []
    for one in species:
        if one.limits is not None:
            own = one.limits.digest == same
            span = (one.limits.nearest_m, one.limits.farthest_m) if own else (0.0, inf)
            found += lacking(one, focal_px, *span)
    return list(dict.fromkeys(found))


def without_original(one: Species) -> list[str]:
    """What is said of a species of which something is made that is made of originals."""
    if one.whole or one.made_for is None:
        return []
    return [
        "lacks the original, which coarser levels and surfels are made of; they are made of its "
        f"finest level; {again_of(one.made_for)}"
    ]
