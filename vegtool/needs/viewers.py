"""Where the eyes of a scene may be, and bounds of how near, how far and in which direction that is.

All bounds are on the safe side: no eye is nearer, farther or elsewhere than they say, to rounding.
In the plane of x and z those of an area are exact, and those of a path to FLAT_M; heights are those
of cells (cells.py).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from vegtool.arrays import FloatArray
from vegtool.camera_path.course import Course, course_of
from vegtool.camera_path.file import CameraPath, read_path
from vegtool.errors import UsageError
from vegtool.lod import Display
from vegtool.needs.cells import (
    Cells,
    Pieces,
    Range,
    cells_of_area,
    cells_of_path,
    outline_of_path,
    pieces_of,
)
from vegtool.needs.floor import Floor, floor_of
from vegtool.needs.planar import gaps, reaches, within
from vegtool.scene import Scene
from vegtool.tiles.placement import Placement
from vegtool.tiles.terrain import Terrain

UNDER_M = 0.1
"""How far below the ground a path may lead before it contradicts it: heights are rounded."""
PAIRS = 2**20
"""Points times cells that are looked at at a time."""
ROUNDING = 1e-9
"""Radians, and metres, that what is computed is rounded by, at most."""

Bound = Callable[[FloatArray, Cells], FloatArray]
"""(n, c) metres, of points (n, 3) from the eyes of cells."""


@dataclass(frozen=True, eq=False)
class Directions:
    """From n points, where eyes are.

    start: (n,) radians, azimuth from +z towards +x, and extent: (n,) radians from there on, up to
    2 pi. low, high: (n,) radians above the horizon, -pi / 2 to pi / 2.
    """

    start: FloatArray
    extent: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, eq=False)
class Viewers:
    """Where eyes may be, in the scene's frame.

    cells: what holds all of them. outline: (v, 2) metres x and z, the corners of an area or of the
    line of a path; no eye is farther from it than `reach` metres. course: the path, or None for an
    area. height_m: lowest and highest above the ground as the scene says, or None. above_m: metres,
    the highest that an eye is above the ground; may be infinite. margin_m: how far from the path or
    the area an eye may be. floor: the ground. notes: sentences for the user.
    """

    cells: Cells
    outline: FloatArray
    reach: float
    course: Course | None
    height_m: Range | None
    above_m: float
    margin_m: float
    floor: Floor
    notes: tuple[str, ...] = ()

    def nearest(self, points: FloatArray, radius: FloatArray | float = 0.0) -> FloatArray:
        """(n,) metres: no eye is nearer to the balls about points (n, 3), metres; 0 where one may
        be inside. radius: metres, of all or (n,)."""
        found = np.empty(len(points))
        for part, cells in self._parts(points, self._near, 1.0):
            found[part] = self._near(points[part], cells).min(axis=1)
        return np.asarray(np.maximum(found - radius, 0.0))

    def nearest_to_boxes(self, boxes: FloatArray) -> FloatArray:
        """(n,) metres: no eye is nearer to boxes (n, 2, 3), least and greatest corners in metres;
        0 where one may be inside."""
        found = np.empty(len(boxes))
        count = max(PAIRS // (4 * len(self.cells)), 1)
        for first in range(0, len(boxes), count):
            part = slice(first, first + count)
            low, high = boxes[part, 0], boxes[part, 1]
            found[part] = self._apart(low, high, self.cells).min(axis=1)
        return found

    def farthest(self, points: FloatArray) -> FloatArray:
        """(n,) metres: no eye is farther from points (n, 3), metres; may be infinite."""
        found = np.empty(len(points))
        for part, cells in self._parts(points, self._far, -1.0):
            found[part] = self._far(points[part], cells).max(axis=1)
        return found

    def directions(
        self,
        points: FloatArray,
        radius: FloatArray | float = 0.0,
        ceiling: FloatArray | None = None,
    ) -> Directions:
        """Where eyes are as seen from points (n, 3), metres; anywhere where one may be within a
        radius, metres. ceiling: (n,) metres, heights in the scene's frame; eyes above do not count,
        unless all are."""
        return Directions(*self.azimuths(points, radius), *self.elevations(points, radius, ceiling))

    def azimuths(
        self, points: FloatArray, radius: FloatArray | float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """start and extent of `directions`."""
        inside = self.nearest(points, radius) <= 0
        start, extent = self._azimuths(points)
        return np.where(inside, 0.0, start), np.where(inside, 2 * np.pi, extent)

    def elevations(
        self,
        points: FloatArray,
        radius: FloatArray | float = 0.0,
        ceiling: FloatArray | None = None,
    ) -> tuple[FloatArray, FloatArray]:
        """low and high of `directions`."""
        inside = self.nearest(points, radius) <= 0
        low, high = self._elevations(points, ceiling)
        return np.where(inside, -np.pi / 2, low), np.where(inside, np.pi / 2, high)

    def _elevations(
        self, points: FloatArray, ceiling: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        found = np.empty((2, len(points)))
        count = max(PAIRS // (4 * len(self.cells)), 1)
        for first in range(0, len(points), count):
            part = slice(first, first + count)
            y, cells = points[part, 1, None], self.cells
            near, far = self._between(points[part], cells)
            top, counts = cells.high, np.ones(near.shape, np.bool_)
            if ceiling is not None:
                limit = ceiling[part, None]
                below = cells.low <= limit
                counts = below | ~below.any(axis=1, keepdims=True)
                top = np.where(below, np.minimum(cells.high, limit), cells.high)
            up, down = top - y, cells.low - y
            high = np.arctan2(up, np.where(up > 0, near, far))
            low = np.arctan2(down, np.where(down > 0, far, near))
            found[0, part] = np.where(counts, low, np.pi / 2).min(axis=1)
            found[1, part] = np.where(counts, high, -np.pi / 2).max(axis=1)
        return found[0], found[1]

    def _azimuths(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) starts and extents: the angles of the outline's corners, followed from each to the
        next, and of the circles about them."""
        line = self.outline
        if self.course is None:
            line = np.concatenate([line, line[:1]])
        found = np.empty((2, len(points)))
        count = max(PAIRS // len(line), 1)
        for first in range(0, len(points), count):
            part = slice(first, first + count)
            flat = points[part][:, [0, 2]]
            x, z = line[:, 0] - flat[:, :1], line[:, 1] - flat[:, 1:]
            angle = np.arctan2(x, z)
            turn = np.diff(angle, axis=1)
            turn -= 2 * np.pi * np.round(turn / (2 * np.pi))
            angle[:, 1:] = angle[:, :1] + np.cumsum(turn, axis=1)
            away = np.maximum(np.hypot(x, z), 1e-300)
            wide = np.arcsin(np.minimum(self.reach / np.maximum(away, self.reach), 1.0))
            start = (angle - wide).min(axis=1) - ROUNDING
            extent = (angle + wide).max(axis=1) + ROUNDING - start
            ends = np.roll(self.outline, -1, axis=0) if self.course is None else line[1:]
            begins = line[:-1] if len(line) > 1 else line
            ends = ends if len(line) > 1 else line
            held = gaps(flat, flat, begins, ends).min(axis=1) <= self.reach
            if self.course is None:
                held |= within(flat, self.outline)
            held |= extent >= 2 * np.pi
            found[0, part] = np.where(held, 0.0, start % (2 * np.pi))
            found[1, part] = np.where(held, 2 * np.pi, extent)
        return found[0], found[1]

    def _apart(self, low: FloatArray, high: FloatArray, cells: Cells) -> FloatArray:
        """(n, c) metres: least distance between boxes (n, 3) to (n, 3) and the eyes of cells."""
        flat_low = low[:, [0, 2]]
        flat_high = flat_low if low is high else high[:, [0, 2]]
        flat = np.maximum(gaps(flat_low, flat_high, cells.start, cells.end) - cells.radius, 0.0)
        flat = np.maximum(flat, self._beside(flat_low, flat_high)[:, None])
        up = np.maximum(cells.low - high[:, 1, None], low[:, 1, None] - cells.high)
        return np.hypot(flat, np.maximum(up, 0.0))

    def _beside(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """(n,) metres: least distance of rectangles in the plane from an area, 0 for a path, whose
        cells say it."""
        if self.course is not None:
            return np.zeros(len(low))
        ends = np.roll(self.outline, -1, axis=0)
        away = np.maximum(gaps(low, high, self.outline, ends).min(axis=1) - self.reach, 0.0)
        return np.where(within(low, self.outline), 0.0, away)

    def _between(self, points: FloatArray, cells: Cells) -> tuple[FloatArray, FloatArray]:
        """(n, c) metres in the plane: least and greatest distance of points from eyes of cells."""
        flat = points[:, [0, 2]]
        near = np.maximum(gaps(flat, flat, cells.start, cells.end) - cells.radius, 0.0)
        near = np.maximum(near, self._beside(flat, flat)[:, None])
        far = reaches(flat, flat, cells.start, cells.end) + cells.radius
        whole = reaches(flat, flat, self.outline, self.outline).max(axis=1) + self.reach
        return near, np.minimum(far, whole[:, None])

    def _near(self, points: FloatArray, cells: Cells) -> FloatArray:
        return self._apart(points, points, cells)

    def _far(self, points: FloatArray, cells: Cells) -> FloatArray:
        _, flat = self._between(points, cells)
        y = points[:, 1, None]
        return np.hypot(flat, np.maximum(np.abs(y - cells.low), np.abs(y - cells.high)))

    def _parts(
        self, points: FloatArray, bound: Bound, sign: float
    ) -> Iterator[tuple[slice, Cells]]:
        """Parts of points, with the cells that decide there where sign times a bound is least.

        A cell's bound changes by no more than a point is moved: what is not among the best for the
        middle of all points, by twice as far as they are from it, is so for none.
        """
        if not len(points):
            return
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        spread = float(np.linalg.norm(points - middle, axis=1).max())
        there = sign * bound(middle[None], self.cells)[0]
        cells = self.cells.only(there <= there.min() + 2 * spread + ROUNDING)
        count = max(PAIRS // len(cells), 1)
        for first in range(0, len(points), count):
            yield slice(first, first + count), cells


def viewers_of(scene: Scene, ground: Terrain, placement: Placement | None = None) -> Viewers:
    """Where the eyes of a scene may be, by its [camera]: along its path, in its polygon, or, where
    it says neither, all over the extent of the ground, or of the plants where that has none.

    Eyes of an area are as high above the ground as height_m, or anywhere above it where that is not
    said; those of a path are as high as the path is, or as height_m. All within margin_m.
    Raises UsageError, with file and line, for a path that cannot be read, one that leads under the
    ground, a polygon that the heightmap does not reach, and a path beside a polygon; ValueError
    where nothing says how far the scene reaches.
    """
    camera, floor = scene.camera, floor_of(ground, placement)
    margin, height = camera.margin_m or 0.0, camera.height_m
    if camera.path is not None and camera.polygon:
        raise UsageError(
            f"{scene.at('camera', 'polygon')}: expected a path or a polygon; got both, the path in "
            f"{scene.at('camera', 'path')}; leave out one of the two"
        )
    if camera.path is not None:
        path = read_path(scene.path.parent / camera.path)
        return _along(course_of(path, floor.terrain.height), margin, floor, height)
    notes = []
    if camera.polygon:
        corners = np.array(camera.polygon, np.float64)
        _check_on_map(scene, ground, corners)
    else:
        corners = _extent(ground, placement)
        where = f"all over its {np.ptp(corners[:, 0]):g} x {np.ptp(corners[:, 1]):g} m"
        notes.append(f"{scene.path}: no path and no polygon in [camera]: eyes are {where}")
    if height is None:
        notes.append(f"{scene.path}: no height_m in [camera]: eyes are at any height")
    span = height or (0.0, np.inf)
    cells = cells_of_area(corners, margin, floor, span)
    return Viewers(cells, corners, margin, None, height, span[1], margin, floor, tuple(notes))


def display_of(scene: Scene, viewers: Viewers) -> Display:
    """What pictures are shown on: as the scene says, else as usual. Where the path says a narrower
    field of view, that one: it shows plants larger."""
    usual, camera = Display(), scene.camera
    said = [] if camera.fov_y_deg is None else [camera.fov_y_deg]
    if viewers.course is not None and ("fov_y_deg",) in viewers.course.path.lines:
        said.append(viewers.course.path.fov_y_deg)
    return Display(
        min(said, default=usual.fov_y_deg), camera.image_height_px or usual.image_height_px
    )


def _along(course: Course, margin: float, floor: Floor, height: Range | None) -> Viewers:
    pieces = pieces_of(course, margin, floor, height)
    _check_above(course.path, pieces, floor)
    outline, off = outline_of_path(pieces)
    above = float(pieces.above[:, 1].max())
    if height is not None:
        above = max(above, height[1])
    cells = cells_of_path(pieces, margin)
    return Viewers(cells, outline, off + margin, course, height, above, margin, floor)


def _check_above(path: CameraPath, pieces: Pieces, floor: Floor) -> None:
    """Raise UsageError where a path leads under ground that there is."""
    if floor.terrain.kind == "none":
        return
    for number, station in enumerate(path.stations):
        x, y, z = station.position
        ground = float(floor.terrain.height(np.array([[x, z]]))[0])
        own = y if station.above_ground else y - ground
        if own < -UNDER_M:
            raise UsageError(
                f"{path.at(number, 'position')}: position: station {number + 1}, at {x:g}, {z:g}, "
                f"is {-own:.3g} m under the ground; expected none lower than it. Raise it"
            )
    lowest = int(pieces.above[:, 0].argmin())
    if pieces.above[lowest, 0] < -UNDER_M:
        number = int(pieces.station[lowest])
        x, z = pieces.node[lowest]
        raise UsageError(
            f"{path.at(number, 'position')}: after station {number + 1}, at about {x:.4g}, "
            f"{z:.4g}, the path is {-pieces.above[lowest, 0]:.3g} m under the ground; expected it "
            "above. Raise it, or add a station there"
        )


def _check_on_map(scene: Scene, ground: Terrain, corners: FloatArray) -> None:
    """Raise UsageError where an area is beyond a heightmap. Other ground goes on as it is."""
    if ground.kind != "heightmap" or ground.extent is None:
        return
    off = np.flatnonzero(~ground.inside(corners))
    if len(off):
        x, z = corners[off[0]]
        raise UsageError(
            f"{scene.at('camera', 'polygon')}: polygon: expected corners on the heightmap, "
            f"{ground.extent[0]:g} x {ground.extent[1]:g} m about the origin; got {x:g}, {z:g}; "
            "move it there"
        )


def _extent(ground: Terrain, placement: Placement | None) -> FloatArray:
    """(4, 2) corners of all there is."""
    if ground.extent is not None:
        low, high = -ground.extent / 2, ground.extent / 2
    elif placement is not None and len(placement.tiles):
        tiles = placement.tiles
        low, high = tiles.low.min(axis=0)[[0, 2]], tiles.high.max(axis=0)[[0, 2]]
    else:
        raise ValueError("viewers_of: expected ground with an extent, or plants")
    return np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]])
