"""A level as it is made unless something else is asked for: refined, or a hybrid.

Refined levels know wood from leaves and are better where leaves are many, whether alpha cuts them
out or not. Of what a mesh can hold whole, such as low-poly crowns, statues, ground, hybrids err
half as much (docs/methods/hybrid.md): so there both are made, and that which errs less is the
level.
"""

from __future__ import annotations

from dataclasses import replace

from vegtool.lod import Level
from vegtool.measure.scores import scores
from vegtool.plant import Plant
from vegtool.progress import Progress, part_of, silent
from vegtool.refine.level import Source, Wanted, refined_level


def refined_or_hybrid(source: Source, wanted: Wanted, progress: Progress = silent) -> Level:
    """The level that errs less (FLIP) at the nearest distance, of no more triangles either way."""
    if not wanted.textured or not mesh_holds(source.plant, wanted.triangles):
        return refined_level(source, wanted, progress)
    from vegtool.hybrid.level import hybrid_level  # most plants have leaves, and need none
    from vegtool.hybrid.options import Budget

    refined = refined_level(source, wanted, part_of(progress, 0.0, 0.4))
    hybrid = hybrid_level(
        source, wanted, Budget(wanted.triangles), progress=part_of(progress, 0.4, 0.6)
    )
    truth = source.truth_at(wanted.near_m)
    errs = [float(scores(truth, level).values["flip"].mean()) for level in (refined, hybrid)]
    level = hybrid if errs[1] < errs[0] else refined
    seconds = {key: refined.seconds.get(key, 0.0) + hybrid.seconds.get(key, 0.0)
               for key in {**refined.seconds, **hybrid.seconds}}  # fmt: skip
    return replace(level, seconds=seconds)


def mesh_holds(plant: Plant, triangles: int) -> bool:
    """Whether so many can show all connected pieces of a plant, of which alpha cuts out nothing."""
    if any(material.alpha_mode == "mask" for material in plant.materials):
        return False
    from vegtool.hybrid.reduction import FEWEST
    from vegtool.meshes.pieces import all_welded, pieces

    count, _ = pieces(all_welded(plant).faces)
    return FEWEST * count <= triangles
