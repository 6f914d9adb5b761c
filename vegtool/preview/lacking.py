"""What is said of plants that were converted for the eyes of another scene."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from pathlib import Path

from vegtool.lod import Display
from vegtool.preview.world import World
from vegtool.scene import Scene
from vegtool.tiles.limits import digest_of, lacking


def notes_on_limits(
    world: World, scene: Scene | None, way: Path | None, height_px: int, fov_y_deg: float
) -> tuple[str, ...]:
    """Sentences, one for each thing that is missing of a plant. way: the path that is walked, in
    place of the scene's own. height_px, fov_y_deg: of the pictures; the narrowest field of view.

    Raises UsageError where [camera] contradicts itself, the ground or the plants.
    """
    if all(one.made_for is None for one in world.species):
        return ()
    spans = _spans(world, scene, way)
    focal_px = Display(fov_y_deg, height_px).pixels_per_metre(1.0)
    found = [
        note
        for one, span in zip(world.species, spans, strict=True)
        for note in lacking(one, focal_px, *span)
    ]
    return tuple(dict.fromkeys(found))


def _spans(world: World, scene: Scene | None, way: Path | None) -> list[tuple[float, float]]:
    """Of each species, from how near and how far it may be seen."""
    anywhere = [(0.0, inf)] * len(world.species)
    if scene is None:
        return anywhere
    own = scene.camera.path
    if way is not None and (own is None or scene.path.parent / own != way):
        camera = replace(scene.camera, path=str(way.absolute()), polygon=())
        scene = replace(scene, camera=camera)
    if scene.camera.path is None and not scene.camera.polygon:
        return anywhere
    same = digest_of(scene)
    limits = [one.limits for one in world.species]
    if all(one is None or one.digest == same for one in limits):
        return [(0.0, inf) if one is None else (one.nearest_m, one.farthest_m) for one in limits]
    from vegtool.needs.need import needs_of

    needs = needs_of(scene, world.species, world.placement, world.terrain)
    return [(need.nearest, need.farthest) for need in needs]
