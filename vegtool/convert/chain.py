"""The pipeline for one plant: Plant and options in, a chain of levels out.

Every level is made for half the size on the screen of the one before, with half of its triangles,
and its atlas, where it has one, holds one texel per pixel at that size. What makes it is
refine/level.py or, with --refine none, the method of Colditz et al. 2005, section 2: clusters of
the plant's faces, a box around each, one to three billboards per box, textures baked from the
faces. From where it may be used is measured then (measure/chain.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

from vegtool.convert.makers import level_maker, most_billboards
from vegtool.convert.options import (
    MAKING,
    MOST_OF_PREVIOUS,
    NEAR_LIMITS,
    PREPARING,
    SURFEL_BILLBOARDS,
    SURFELS,
    TRIANGLES_PER_BILLBOARD,
    ConvertOptions,
)
from vegtool.convert.seen import beginning, complete, drawn, omitted, tries
from vegtool.convert.textures import seen_textures
from vegtool.errors import QualityError
from vegtool.lighting.crown import crown_normals
from vegtool.lighting.leaves import translucent
from vegtool.lighting.light import Sun
from vegtool.limits import ANYWHERE, Limits, Omitted, Span
from vegtool.lod import Level, LodChain
from vegtool.measure.distances import rounded_up
from vegtool.measure.options import MeasureOptions
from vegtool.measure.views import distance_of
from vegtool.options import check_limits
from vegtool.plant import Plant
from vegtool.progress import Progress, silent
from vegtool.surfels.options import POINTS_SUFFIX, SUFFIX

if TYPE_CHECKING:
    from vegtool.measure.scores import TruthsAt


def convert(
    plant: Plant,
    options: ConvertOptions | None = None,
    measure: MeasureOptions | None = None,
    progress: Progress = silent,
    limits: Limits | None = None,
) -> LodChain:
    """Make the chain of levels of one plant.

    levels[0] is the plant itself. Of the others there is one at least, and no more than save
    triangles and may be used somewhere; `notes` name those that are of no use, and those that are
    used farther than their coverage keeps. limits: the eyes that it is for; what none of them sees
    is not made, be it a level or the plant itself (seen.py). Raises UsageError for options out of
    range, QualityError where no level keeps to `measure.max_error`, CapabilityError where nothing
    can draw.
    """
    from vegtool.baking.bake import PlantBuffers
    from vegtool.gl.sun import SunMaps
    from vegtool.measure.chain import views_of
    from vegtool.measure.scores import Shadowed, TruthsAt

    options, measure = options or ConvertOptions(), measure or MeasureOptions()
    check_limits(options)
    check_limits(measure)
    sun = options.baked_sun
    plant = as_lit(plant, options)
    making = 1.0 if measure.measure == "off" else MAKING
    original = Level("mesh", mesh=plant, geometric_error_m=(0.0, 0.0))
    span = ANYWHERE if limits is None else limits.span(options.display)
    with ExitStack() as stack:
        buffers = stack.enter_context(PlantBuffers(plant))
        under = None
        if sun is not None:
            maps = stack.enter_context(SunMaps([buffers], sun.direction))
            under = Shadowed(sun.light, maps)
        truth_at = TruthsAt(plant, views_of(measure), options.display, buffers, under)
        baked_from = buffers
        if options.crown_normals:
            crowned = crown_normals(plant, options.crown_normals)
            baked_from = stack.enter_context(PlantBuffers(crowned))
        prepared = options.method in (SURFELS, SURFEL_BILLBOARDS)
        before = PREPARING * making if prepared else 0.0
        make = level_maker(
            baked_from, truth_at, options, progress=lambda s, f: progress(s, before * f)
        )
        farthest = rounded_up(distance_of(plant, options.display, NEAR_LIMITS[0]))
        whole = make.wanted(plant, farthest)
        attempts, made = list(tries(whole, span, make.fewer)), dict[tuple[int, float], Level]()
        for wanted in attempts:
            levels = [original]
            for index, (count, near) in enumerate(wanted):

                def report(
                    stage: str, fraction: float, index: int = index, of: int = len(wanted)
                ) -> None:
                    done = before + (making - before) * (index + fraction) / of
                    progress(f"LOD{index + 1}: {stage}", done)

                if (count, near) not in made:
                    level = make(count, min(near, farthest), report)
                    made[count, near] = replace(level, near_distance_m=near)
                level = made[count, near]
                saves = level.triangles <= MOST_OF_PREVIOUS * levels[-1].triangles
                if saves or (index == len(wanted) - 1 and len(levels) == 1):
                    levels.append(level)
            kept, notes = _measured(
                plant, levels[1:], measure, options,
                lambda stage, fraction: progress(stage, making + (1 - making) * fraction),
                truth_at, span, last=wanted is attempts[-1],
            )  # fmt: skip
            kept = drawn(kept, span)
            if complete(kept, span):
                break
        shadow = None
        if options.shadow_proxy is not None:
            from vegtool.refine.shadow_proxy import shadow_proxy

            most = min(options.shadow_proxy // TRIANGLES_PER_BILLBOARD, most_billboards(plant))
            shadow = shadow_proxy(
                plant,
                options.display,
                lambda casting, seen, near_m: level_maker(casting, seen, options, casts=True)(
                    most, near_m, lambda stage, _: progress(stage, making)
                ),
                (wanted or whole)[0][1],
            )
        if options.refine != "none" and options.method != SURFELS:
            from vegtool.refine.reach import coverage_notes

            notes = (*notes, *coverage_notes(kept, truth_at))
    notes = (*notes, *light_notes(plant, sun))
    # surfels are no triangles, which who draws them begins with
    is_whole = options.method == SURFELS or not complete(kept, span)
    misses = (*budget_notes(kept, options, int(is_whole)), *make.misses)
    beside = make.beside()
    if SUFFIX in beside and (sun is not None or plant.exposure is not None):
        notes = (*notes, f"light that is baked is in the levels, not in {plant.name}{SUFFIX}")
    progress("levels", 1.0)
    told = {**asdict(options), **asdict(measure)}
    baked = {} if sun is None else sun.as_dict()
    left_out = tuple[Omitted, ...]()
    if limits is not None:
        left_out = omitted(whole, wanted, original, is_whole, limits)
        if is_whole:
            original, smaller = _smaller(original, limits)
            left_out = (*left_out, *smaller)
    if left_out:
        notes = (*notes, f"left out for the scene: {_listed(left_out)}")
    return LodChain(
        plant.name,
        (original, *kept) if is_whole else beginning(kept),
        options.display,
        options.seed,
        told,
        notes,
        baked,
        shadow,
        misses,
        beside,
        limits,
        left_out,
        None if is_whole else plant,
    )


def _measured(
    plant: Plant, levels: Sequence[Level], measure: MeasureOptions, options: ConvertOptions,
    progress: Progress, truth_at: TruthsAt, span: Span, last: bool,
) -> tuple[tuple[Level, ...], tuple[str, ...]]:  # fmt: skip
    """`with_distances`; none where there are none, or where none keeps to the limit and it is not
    the last try."""
    from vegtool.measure.chain import with_distances

    if not levels:
        return (), ()
    try:
        return with_distances(plant, levels, measure, options.display, progress, truth_at, span)
    except QualityError:
        if last:
            raise
        return (), ()


def _smaller(original: Level, limits: Limits) -> tuple[Level, tuple[Omitted, ...]]:
    """The original without texels that nobody sees."""
    assert original.mesh is not None
    reduced = replace(original, mesh=seen_textures(original.mesh, limits))
    fewer = original.texels - reduced.texels
    if not fewer:
        return original, ()
    what = f"{fewer:,} of the original's {original.texels:,} texels"
    return reduced, (Omitted(what, "smaller than a pixel from as near as any eye is"),)


def _listed(left_out: Sequence[Omitted]) -> str:
    levels = sum(one.what.startswith("a level") for one in left_out)
    others = [one.what for one in left_out if not one.what.startswith("a level")]
    return ", ".join([*others, *([f"{levels} of its levels"] if levels else [])])


def endings(options: ConvertOptions) -> tuple[str, ...]:
    """Of the names of files that are made beside the levels (LodChain.beside)."""
    return {SURFELS: (POINTS_SUFFIX,), SURFEL_BILLBOARDS: (SUFFIX,)}.get(options.method, ())


def budget_notes(
    levels: Sequence[Level], options: ConvertOptions, first: int = 1
) -> tuple[str, ...]:
    """Sentences on hybrids of more triangles than were allowed. first: number of the first."""
    if options.triangles is None:
        return ()
    over = [
        f"LOD{number}: no hybrid was found of {options.triangles:,} triangles or fewer; it has "
        f"{level.triangles:,}"
        for number, level in enumerate(levels, start=first)
        if level.triangles > options.triangles
    ]
    return tuple(over)


def light_notes(plant: Plant, sun: Sun | None) -> tuple[str, ...]:
    """Sentences on light that is not what it may seem."""
    notes = []
    if sun is not None and sun.elevation_deg < 0:
        notes.append("the sun is below the horizon: the levels' colours have the sky's light alone")
    unlit = [material.name for material in plant.materials if material.unlit]
    if 0 < len(unlit) < len(plant.materials):
        notes.append(f"unlit beside others that are lit: levels light it too: {', '.join(unlit)}")
    return tuple(notes)


def as_lit(plant: Plant, options: ConvertOptions) -> Plant:
    """The plant with what the options say of light: its exposure, and what leaves let through."""
    if options.translucency is not None:
        plant = translucent(plant, options.translucency)
    strength = float(options.prelit) if options.occlusion is None else options.occlusion
    if strength:
        from vegtool.refine.occlusion import exposed

        plant = exposed(plant, strength)
    return plant
