"""How far billboards may draw a surface from its place, in pixels, known without drawing.

Paper: Holst and Schumann (2007), Surfel-Based Billboard Hierarchies, sections 3.2 and 3.3, eq. 1 to
9, with w, h, d half extents. Their e_p (eq. 4) looks at a billboard's middle and across its plane
alone, and says itself that it may be too small; `projection_bound` and `displacement_bound` never
are. What follows from what, and how often e_p falls short: docs/methods/bounds.md.

Every plane answers for all the surface that it draws, so of crossed planes each counts with its
own depth (`geometric_error` asks for the nearest one instead).
"""

from __future__ import annotations

from math import inf, sqrt

import numpy as np

from vegtool.arrays import FloatArray, IntArray
from vegtool.lod import Atlas, Billboards, Display, Level
from vegtool.measure.views import Camera
from vegtool.plant import Plant

VALID_SHARE = 0.5
"""theta of eq. 7: the share of all directions in which a billboard is to be valid."""
MIN_DEPTH = 1e-3
"""Least half depth that eq. 8 and 9 take, as a fraction of the rectangle's half diagonal: a flat
cluster would be valid at any distance, and its texture would have no limit."""
_HALVINGS = 200
"""More than separate any two float64: the search ends when it no longer moves."""


def projection_error(billboards: Billboards, camera: Camera) -> FloatArray:
    """(p,) pixels, e_p of eq. 4: the half depth, seen across, at the distance of the middle.

    Not a bound. Infinite behind the eye, unless it is 0.
    """
    middle = _points_seen(billboards.center, camera)
    normal = _vectors_seen(billboards.normal, camera)
    length = np.linalg.norm(middle, axis=1)
    # |M x n| is |M| |sin beta|; the paper's root of 1 - cos^2 loses half its digits near 0
    across = billboards.half_depth * np.linalg.norm(np.cross(middle, normal), axis=1)
    return camera.focal_px * _over(across, length * middle[:, 2])


def texel_error(billboards: Billboards, atlas: Atlas, camera: Camera) -> FloatArray:
    """(p,) e_t of eq. 5: pixels that a texel covers at the distance of the middle, seen head-on.

    A back picture has as many texels as the front's, or shows nothing, so the front's count.
    Infinite where the middle is not in front of the eye.
    """
    depth = _points_seen(billboards.center, camera)[:, 2]
    return camera.focal_px * _over(_texel_size(billboards, atlas), depth)


def least_distance(
    billboards: Billboards, display: Display, pixels: float, valid_share: float = VALID_SHARE
) -> FloatArray:
    """(p,) metres, z_min of eq. 8: from here on e_p is at most `pixels` in most directions.

    valid_share: theta of eq. 7, that share of all directions; 1 for every direction (eq. 6 with
    beta 90 degrees). Boxes are taken to be at least MIN_DEPTH thick.
    """
    return _tilted_depth(billboards, valid_share) * (display.pixels_per_metre(1.0) / pixels)


def texture_size(
    billboards: Billboards, most: int, valid_share: float = VALID_SHARE
) -> tuple[IntArray, IntArray]:
    """Two (p,) int32: texels along u and v (eq. 9), so that e_t equals e_p at `least_distance`.

    At least one texel and no more than `most`. Boxes are taken to be at least MIN_DEPTH thick.
    """
    depth = _tilted_depth(billboards, valid_share)[:, None]
    half = billboards.half_size
    exact = np.divide(2 * half, depth, out=np.ones_like(half), where=depth > 0)
    width, height = np.clip(np.ceil(exact), 1, most).astype(np.int32).T
    return width, height


def displacement(
    points: FloatArray, shown_by: IntArray, billboards: Billboards, camera: Camera
) -> FloatArray:
    """(n,) pixels between where points lie in the picture and where their billboards draw them.

    That is eq. 2 before its maximum. points: (n, 3) metres. shown_by: (n,) the billboard of each.
    Infinite where one of the two places is not in front of the eye.
    """
    normal = billboards.normal[shown_by]
    away = np.einsum("ni,ni->n", points - billboards.center[shown_by], normal)
    true = _points_seen(points, camera)
    seen_normal = _vectors_seen(normal, camera)
    drawn = true - away[:, None] * seen_normal
    # x / z - x' / z' in one fraction, which loses no digits where the two places are close
    across = true[:, 2:] * seen_normal[:, :2] - seen_normal[:, 2:] * true[:, :2]
    length = np.abs(away) * np.linalg.norm(across, axis=1)
    in_front = (true[:, 2] > 0) & (drawn[:, 2] > 0)
    both = np.where(in_front, true[:, 2] * drawn[:, 2], 0.0)
    return camera.focal_px * _over(length, both)


def projection_bound(billboards: Billboards, camera: Camera) -> FloatArray:
    """(p,) pixels, the most by which a billboard can displace anything in its box, in this view.

    Infinite where the box reaches behind the eye. A flat cluster is displaced by nothing.
    """
    seen_normal = _vectors_seen(billboards.normal, camera)
    corners = _corners(billboards) - camera.target
    x, y, back = np.moveaxis(corners @ camera.axes.T, -1, 0)  # (p, 4) each
    depth = camera.distance_m - back
    nearest = depth.min(axis=1) - billboards.half_depth * np.abs(seen_normal[:, 2])
    safe = np.where(nearest[:, None] > 0, depth, 1.0)
    image = np.stack([x / safe, y / safe], axis=-1)  # (p, 4, 2), where the corners are seen
    across = seen_normal[:, None, :2] - seen_normal[:, None, 2:] * image
    most = np.linalg.norm(across, axis=-1).max(axis=1)
    return camera.focal_px * _over(billboards.half_depth * most, nearest)


def displacement_bound(
    billboards: Billboards, center: FloatArray, distance_m: float, display: Display
) -> FloatArray:
    """(p,) pixels, the most by which billboards can displace anything, from every direction.

    The eye is anywhere at `distance_m` metres from `center`, (3,), and looks at it. Infinite where
    it may lie within reach of the billboard's box.
    """
    pixels = magnification(_reach(billboards, center), distance_m, display)
    return _times(billboards.half_depth, pixels)


def magnification(reach: FloatArray, distance_m: float, display: Display) -> FloatArray:
    """Most pixels that a metre within `reach` metres of the point looked at can cover.

    In front of that point from twice its reach on; from nearer, at the side, where the image plane
    is slanted. Infinite where the eye is within reach.
    """
    outside = np.where(reach < distance_m, reach, 0.0) / distance_m
    front = 1 / (1 - outside)
    side = 0.75 * sqrt(3) / (1 - outside**2) ** 1.5
    factor = np.where(outside <= 0.5, front, side)
    return np.where(reach < distance_m, factor * display.pixels_per_metre(distance_m), inf)


def distance_for_pixels(level: Level, center: FloatArray, display: Display, pixels: float) -> float:
    """Metres from `center`, (3,), from which a level is valid to `pixels` from every direction.

    That is eq. 1 with bounds for both errors: nothing is drawn further than that from its place,
    and no texel covers more. A mesh counts by the level's geometric error, of which a hybrid's own
    is a part, and so do surfels; the original's distance is 0. Raises ValueError where that error
    is not known.
    """
    size, reach = np.zeros(0), np.zeros(0)
    if level.billboards is not None and level.atlas is not None:
        texel = _texel_size(level.billboards, level.atlas)
        size = np.maximum(level.billboards.half_depth, texel)
        reach = _reach(level.billboards, center)
    shown = level.mesh if level.surfels is None else level.surfels
    if shown is not None:
        if level.geometric_error_m is None:
            raise ValueError(
                "distance_for_pixels: a mesh, or surfels, need their geometric_error_m"
            )
        error = level.geometric_error_m[0]
        places = shown.positions if isinstance(shown, Plant) else shown.position
        farthest = np.linalg.norm(places - center, axis=1).max(initial=0.0)
        size, reach = np.append(size, error), np.append(reach, farthest + error)

    if not size.any():
        return 0.0

    def most(distance_m: float) -> float:
        return float(_times(size, magnification(reach, distance_m, display)).max())

    # beyond twice its reach, a billboard's error falls as 1 / (distance - reach)
    far = float(np.maximum(2 * reach, reach + display.distance_m(1.0) * size / pixels).max())
    far *= 1 + 1e-12
    near = 0.0
    for _ in range(_HALVINGS):
        middle = (near + far) / 2
        if not near < middle < far:
            break
        near, far = (near, middle) if most(middle) <= pixels else (middle, far)
    return far


def _points_seen(points: FloatArray, camera: Camera) -> FloatArray:
    """(n, 3) metres to the right of the eye, above it and in front of it."""
    x, y, back = camera.axes @ (points - camera.target).T
    return np.stack([x, y, camera.distance_m - back], axis=1)


def _vectors_seen(vectors: FloatArray, camera: Camera) -> FloatArray:
    """(n, 3) directions by the same axes."""
    return np.asarray(vectors @ camera.axes.T * [1.0, 1.0, -1.0])


def _corners(billboards: Billboards) -> FloatArray:
    """(p, 4, 3) metres, the corners of the rectangles."""
    along = billboards.half_size[:, :1] * billboards.u
    up = billboards.half_size[:, 1:] * billboards.v
    steps = np.stack([-along - up, along - up, along + up, up - along], axis=1)
    return np.asarray(billboards.center[:, None] + steps)


def _reach(billboards: Billboards, center: FloatArray) -> FloatArray:
    """(p,) metres from `center` to the farthest corner of each box."""
    axes = np.stack([billboards.u, billboards.v, billboards.normal], axis=1)
    half = np.concatenate([billboards.half_size, billboards.half_depth[:, None]], axis=1)
    offset = np.abs(np.einsum("pai,pi->pa", axes, billboards.center - center))
    return np.asarray(np.linalg.norm(offset + half, axis=1))


def _texel_size(billboards: Billboards, atlas: Atlas) -> FloatArray:
    """(p,) metres, the longer side of a billboard's texels."""
    return np.asarray((2 * billboards.half_size / atlas.front[:, 2:]).max(axis=1))


def _tilted_depth(billboards: Billboards, valid_share: float) -> FloatArray:
    """(p,) metres: d sqrt(theta (2 - theta)), the depth seen at the edge of the valid caps."""
    floor = MIN_DEPTH * np.linalg.norm(billboards.half_size, axis=1)
    depth = np.maximum(billboards.half_depth, floor)
    return np.asarray(depth * sqrt(valid_share * (2 - valid_share)))


def _over(length: FloatArray, depth: FloatArray) -> FloatArray:
    """length / depth; infinite where the depth is not positive, and 0 where the length is 0."""
    ratio = np.divide(length, depth, out=np.full_like(length, inf), where=depth > 0)
    return np.where(length > 0, ratio, 0.0)


def _times(length: FloatArray, pixels: FloatArray) -> FloatArray:
    """length * pixels, 0 where the length is 0, even by infinite pixels."""
    return np.multiply(length, pixels, out=np.zeros_like(length), where=length > 0)
