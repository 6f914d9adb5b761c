"""Cameras at their limits: where points are seen, what they cover, from where levels are used."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from functools import cache, partial
from math import radians, tan

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.convert import ConvertOptions, convert
from vegtool.errors import UsageError
from vegtool.gl.upload import PlantBuffers
from vegtool.lod import Display
from vegtool.measure.metrics import reference, score
from vegtool.measure.options import MeasureOptions
from vegtool.measure.pictures import TRUTH_SUPERSAMPLE, live, truth
from vegtool.measure.views import Camera, around, direction, distance_of
from vegtool.plant import Material
from vegtool.seeding import generator
from vegtool.stability.case import (
    Case,
    Outcome,
    drawn,
    exact,
    holds,
    relative,
    same_objective,
)
from vegtool.stability.plants import MOTIONS, Motion, box_faces, rotated, soup, tree

SIDE = 64
"""Pixels of most pictures here."""
UPRIGHT = np.array([[0.6, 0.0, 0.8], [0.0, 1.0, 0.0], [-0.8, 0.0, 0.6]])
"""A turn about the vertical, which leaves the camera upright."""
UPRIGHT_MOTIONS = (
    *(motion for motion in MOTIONS if not motion.turns),
    Motion("turned about the vertical", lambda p: rotated(p, UPRIGHT), UPRIGHT),
)


def plate(half: float, z: float = 0.0) -> FloatArray:
    """(2, 3, 3) an upright square about the z axis."""
    a, b, c, d = (
        np.array([x, y, z]) for x, y in ((-half, -half), (half, -half), (half, half), (-half, half))
    )
    return np.array([[a, b, c], [a, c, d]])


def camera(fov: float, distance_m: float, depth_m: float, view: FloatArray | None = None) -> Camera:
    """A camera that looks at the origin, along z where no direction is given."""
    focal = SIDE / (2 * tan(radians(fov) / 2))
    towards = np.array([0.0, 0.0, 1.0]) if view is None else view
    middle = (SIDE / 2, SIDE / 2)
    return Camera(np.zeros(3), towards, distance_m, focal, SIDE, SIDE, middle, depth_m)


def projected_exactly(fov: float, distance_m: float) -> Outcome:
    """Where a camera sees points in its view, against rational numbers; in picture widths."""
    seen = camera(fov, distance_m, distance_m)
    random = generator(0, "stability", "points")
    points = random.uniform(-1, 1, (200, 3)) * distance_m
    points[:, 2] *= 0.999
    found = seen.pixels(points)
    error = 0.0
    for (x, y, z), pixel in zip(points.tolist(), found.tolist(), strict=True):
        scale = Fraction(seen.focal_px) / (Fraction(distance_m) - Fraction(z))
        right = Fraction(SIDE, 2) + Fraction(x) * scale, Fraction(SIDE, 2) - Fraction(y) * scale
        for is_at, should in zip(pixel, right, strict=True):
            error = max(error, abs(float(Fraction(is_at) - should)) / max(abs(float(should)), SIDE))
    return exact(error)


def matrix_agrees(fov: float, distance_m: float, depth_m: float) -> Outcome:
    """The matrix that the GPU gets puts points where `pixels` says, and none beyond its planes.

    The points lie between far and near plane, which is a thousandth of that distance or more.
    """
    seen = camera(fov, distance_m, depth_m, direction(30.0, 20.0))
    far = distance_m + depth_m
    near = max(distance_m - depth_m, 1e-3 * far)
    random = generator(0, "stability", "matrix")
    depth = near * (far / near) ** random.uniform(0.01, 0.99, 200)
    x, y = random.uniform(-0.5, 0.5, (2, 200)) * depth * SIDE / seen.focal_px
    ahead = np.stack([x, y, distance_m - depth], axis=1) @ seen.axes
    clip = np.concatenate([ahead, np.ones((200, 1))], axis=1) @ seen.view_projection().T
    at = SIDE / 2 * (1 + clip[:, :2] / clip[:, 3:] * [1, -1])
    apart = np.abs(at - seen.pixels(ahead)) / np.maximum(np.abs(at), SIDE)
    inside = bool((np.abs(clip) <= clip[:, 3:] * (1 + 1e-9)).all())
    return exact(float(apart.max()) + (not inside), far / near)


def square_seen(fov: float) -> Outcome:
    """A plate whose edges lie on those of pixels: 32 x 32 of them are covered, no more, no less."""
    seen = camera(fov, 10.0, 1.0)
    half = 16 * 10.0 / seen.focal_px
    with PlantBuffers(soup(plate(half))) as buffers:
        covered = float(truth(buffers, seen)[..., 3].sum(dtype=np.float64))
    return exact(relative(covered, 1024.0))


def inside_a_box() -> Outcome:
    """The eye within a closed box: every pixel sees a wall, truth and live alike."""
    seen = replace(camera(90.0, 0.25, 2.0), direction=direction(20.0, 10.0))
    plant = soup(box_faces((1.0, 1.0, 1.0)))
    with PlantBuffers(plant) as sharp, PlantBuffers(plant, mipmaps=True) as mipped:
        least = [float(p[..., 3].min()) for p in (truth(sharp, seen), live(mipped, seen))]
    return exact(1 - min(least))


def grazing() -> Outcome:
    """A plate seen at 89.999 degrees: a line thinner than a sample is wide covers no more than it.

    Its area is known; samples lie on both sides of a line or on none, so it may be off by half a
    sample along its length. Scores against such a truth are numbers.
    """
    tilt = radians(89.999)
    seen = camera(30.0, 10.0, 3.0, np.array([0.0, np.sin(tilt), np.cos(tilt)]))
    corners = seen.pixels(plate(1.0)[:, :3].reshape(-1, 3)[[0, 1, 2, 5]])
    x, y = corners.T
    area = abs(float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum())) / 2
    with PlantBuffers(soup(plate(1.0))) as sharp:
        picture = truth(sharp, seen)
    covered = float(picture[..., 3].sum(dtype=np.float64))
    allowed = float(np.ptp(x)) / TRUTH_SUPERSAMPLE
    scores = score(reference(picture), np.zeros_like(picture))
    wrong = abs(covered - area) > allowed or not np.isfinite(list(scores.values())).all()
    return holds(int(wrong), "at most a row of samples off", note=f"{covered:.3f} of {area:.4f} px")


def small_plant(pixels: float) -> Outcome:
    """A tree of less than a pixel: it covers something within a sample, and scores are numbers."""
    display = Display()
    distance_m = distance_of(tree(), display, pixels)
    seen = around(tree().positions, direction(30.0, 10.0), distance_m, display)
    with PlantBuffers(tree()) as sharp, PlantBuffers(tree(), mipmaps=True) as mipped:
        right, shown = truth(sharp, seen), live(mipped, seen)
    values = list(score(reference(right), shown).values())
    covered = float(right[..., 3].sum(dtype=np.float64))
    wrong = (covered > (pixels + 2 / TRUTH_SUPERSAMPLE) ** 2) + (not np.isfinite(values).all())
    note = f"{covered:.4f} px covered, {seen.width} x {seen.height} pixels"
    return holds(int(wrong), "covers no more than its bounds", note=note)


def nearer_wins(ratio: float) -> Outcome:
    """Two plates, a thousandth of the far plane's distance apart, and both a `ratio`th of it away
    or more: the nearer one is seen everywhere. Near and far planes are never more than 1e3 apart,
    whatever the camera is asked for, so depths stay distinct."""
    far = 1e7
    seen = camera(30.0, far / 2, far / 2)
    z = far / 2 - far * ratio  # of the nearer plate, from the target
    half = far
    near, back = plate(half, z), plate(half, z - far * 1e-3)
    plant = replace(
        soup(np.concatenate([back, near])),
        face_material=np.array([1, 1, 0, 0], dtype=np.int32),
        materials=(
            Material("red", base_color=np.array([1.0, 0, 0, 1]), double_sided=True),
            Material("green", base_color=np.array([0, 1.0, 0, 1]), double_sided=True),
        ),
    )
    with PlantBuffers(plant) as sharp:
        picture = truth(sharp, seen)
    wrong = int((picture[..., 1] > 0).sum()) + int((picture[..., 3] < 1).sum())
    return holds(wrong, "the nearer plate alone is seen")


@cache
def own_picture() -> FloatArray:
    """The tree where it stands."""
    with PlantBuffers(tree()) as buffers:
        return truth(buffers, view_of_tree()).astype(np.float64)


def view_of_tree() -> Camera:
    """The camera that sees the tree 100 pixels large."""
    display = Display()
    seen = camera(
        60.0, distance_of(tree(), display, 100), 1.5 * tree().radius, direction(30.0, 10.0)
    )
    return replace(
        seen, target=tree().center, focal_px=display.pixels_per_metre(1.0),
        width=2 * SIDE, height=2 * SIDE, center_px=(SIDE, SIDE),
    )  # fmt: skip


def moved_camera(motion: Motion) -> Camera:
    """The same camera, moved with the tree."""
    seen = view_of_tree()
    return replace(
        seen,
        target=motion.of(seen.target[None])[0],
        direction=rotated(seen.direction[None], motion.turn)[0],
        distance_m=motion.scale * seen.distance_m,
        depth_m=motion.scale * seen.depth_m,
    )


def moved_picture(motion: Motion) -> Outcome:
    """The tree and its camera, moved as one: as much is covered."""
    here = own_picture()
    with PlantBuffers(motion.plant(tree())) as buffers:
        there = truth(buffers, moved_camera(motion)).astype(np.float64)
    error = relative(float(there[..., 3].sum()), float(here[..., 3].sum()))
    note = f"{float(np.abs(there - here)[..., 3].mean()):.1e} on average a pixel"
    return drawn(error, note=note) if motion.turns else same_objective(error, note=note)


def fields_of_view(fov: float) -> Outcome:
    """Pixels of a metre, against long double; and there and back."""
    display = Display(fov_y_deg=fov)
    half = np.longdouble(fov) / 2 * (4 * np.arctan(np.longdouble(1)) / 180)
    right = np.longdouble(display.image_height_px) / (2 * np.tan(half))
    error = 0.0
    for metres in (1e-6, 1.0, 1e7):
        error = max(
            error,
            abs(float(display.pixels_per_metre(metres) * np.longdouble(metres) / right - 1)),
            relative(display.distance_m(display.pixels_per_metre(metres)), metres),
        )
    return exact(error)


def whole_pipeline(fov: float, height: int) -> Outcome:
    """Levels for such a display, measured; or a sentence that says why there are none."""
    options = ConvertOptions(billboards=24, levels=1, fov=fov, image_height=height)
    try:
        chain = convert(tree(), options, MeasureOptions(measure="quick"))
    except UsageError as error:
        refused = fov > 60 or len(str(error)) < 40  # a wide view alone is no reason
        return holds(refused, "levels, or a sentence why not", note="refused")
    distances = [level.near_distance_m for level in chain.levels[1:]]
    note = ", ".join(f"from {d:.4g} m" for d in distances)
    return holds(
        sum(not 0 < d < np.inf for d in distances), "levels, or a sentence why not", note=note
    )


CASES = (
    *(
        Case(f"points, field of view {fov:g}, {distance:g} m", "cameras", "exact",
             partial(projected_exactly, fov, distance))
        for fov in (1.0, 60.0, 170.0)
        for distance in (1e-3, 10.0, 1e7)
    ),
    *(
        Case(f"matrix, field of view {fov:g}, {distance:g} m, depth {depth:g}", "cameras", "exact",
             partial(matrix_agrees, fov, distance, depth))
        for fov in (1.0, 60.0, 170.0)
        for distance, depth in ((10.0, 1.0), (1e-3, 1e7), (1e7, 1e7))
    ),
    *(
        Case(f"a metre's pixels, field of view {fov:g}", "cameras", "exact",
             partial(fields_of_view, fov))
        for fov in (1.0, 60.0, 170.0)
    ),
    *(
        Case(f"a square, field of view {fov:g}", "cameras", "exact",
             partial(square_seen, fov), gl=True)
        for fov in (1.0, 60.0, 170.0)
    ),
    Case("inside a box", "cameras", "exact", inside_a_box, gl=True),
    Case("grazing, 89.999 degrees", "cameras", "property", grazing, gl=True),
    *(
        Case(f"depth to 1e7 m, plates at {ratio * 1e7:.0e}", "cameras", "property",
             partial(nearer_wins, ratio), gl=True)
        for ratio in (0.01, 0.1, 0.9)
    ),
    *(
        Case(f"a tree of {pixels:g} pixels", "cameras", "property",
             partial(small_plant, pixels), gl=True)
        for pixels in (3.0, 0.5, 0.01)
    ),
    *(
        Case(f"picture of a tree, {motion.name}", "cameras", "equivariance",
             partial(moved_picture, motion), gl=True)
        for motion in UPRIGHT_MOTIONS
    ),
    *(
        Case(f"convert, field of view {fov:g}, {height} pixels high", "cameras", "property",
             partial(whole_pipeline, fov, height), gl=True)
        for fov, height in ((1.0, 1080), (170.0, 1080), (60.0, 16))
    ),
)  # fmt: skip
