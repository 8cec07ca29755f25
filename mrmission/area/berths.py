"""Berths: where k boats that share one start are launched and come home to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely

from mrmission.errors import InfeasibleError
from mrmission.model import BoolArray, FloatArray, read_only

SPACING_HALVINGS = 10
LAUNCH_TOLERANCE_M = 0.01
SHORE_REACH_M = 100.0
"""How far from the start, beyond a row of all berths, one is looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Berths:
    """One berth per robot, robot 1 first.

    Parameters
    ----------
    points_m : (count, 2) float array
        In the navigable region, local frame, m.
    spacing_m : float
        What any two of them are at least apart, m.
    launch_in_water : (count,) bool array
        Whether the launch circle around each lies wholly in the water.
    notes : tuple of str
        What falls short of what was asked.
    """

    points_m: FloatArray
    spacing_m: float
    launch_in_water: BoolArray
    notes: tuple[str, ...] = ()


def berths(
    water_m: shapely.MultiPolygon | shapely.Polygon,
    region_part_m: shapely.Polygon,
    start_m: FloatArray,
    count: int,
    spacing_m: float = 15.0,
    launch_radius_m: float = 15.0,
) -> Berths:
    """Lay out berths near a start: in the region, apart, with room to launch, nearest first.

    Around the start, on a hexagonal lattice along the shore, those points are taken whose launch
    circle lies in the water. Where there are too few, a four times finer lattice and points on the
    region's border are taken too, at first still with the launch circle in the water, then without.
    Where even that does not do, the spacing is halved. All lie in the piece of the region around
    the start that is connected within the distance looked at.

    Parameters
    ----------
    water_m : Polygon or MultiPolygon
        The survey area, for the launch circles, m.
    region_part_m : Polygon
        The part of the navigable region that holds the start.
    start_m : (2,) float array
        A point of that part; outside, the nearest one is meant.
    count : int
        Number of berths.
    spacing_m : float
        Least distance between two berths, m, where there is room.
    launch_radius_m : float
        Radius of the launch circle, m.

    Returns
    -------
    Berths
        Nearest to the start first among those whose launch circle lies in the water, then the
        others.

    Raises
    ------
    InfeasibleError
        When not even a thousandth of the spacing has room.
    """
    start = np.asarray(start_m, dtype=np.float64)
    if region_part_m.distance(shapely.Point(start)) > 0:
        start = shapely.get_coordinates(shapely.shortest_line(shapely.Point(start), region_part_m))[
            1
        ]
    for halving in range(SPACING_HALVINGS + 1):
        spacing = spacing_m / 2**halving
        site = None
        reach_limit = spacing * count + (SHORE_REACH_M if halving == 0 else 2 * spacing)
        reach = min(spacing * (2 + math.sqrt(count)) + launch_radius_m, reach_limit)
        while True:
            site = _Site.of(water_m, region_part_m, start, reach, launch_radius_m)
            chosen = site.choose(count, spacing, open_water=True)
            if chosen is not None or reach >= reach_limit:
                break
            reach = min(2 * reach, reach_limit)
        if chosen is None:
            chosen = site.choose(count, spacing, open_water=False)
        if chosen is not None:
            points, free = chosen
            return Berths(
                points_m=read_only(points),
                spacing_m=spacing,
                launch_in_water=read_only(free),
                notes=_notes(spacing, spacing_m, free, launch_radius_m),
            )
    raise InfeasibleError(
        f"no room for {count} berths near the start, not even "
        f"{spacing_m / 2**SPACING_HALVINGS:.3g} m apart; choose another start or fewer robots"
    )


def _notes(
    spacing: float, asked: float, free: BoolArray, launch_radius_m: float
) -> tuple[str, ...]:
    notes = []
    if spacing < asked:
        notes.append(
            f"berths are {spacing:.3g} m apart, not {asked:g} m: there is no more room near the "
            "start; launch the boats one after the other"
        )
    if not free.all():
        blocked = np.flatnonzero(~free)
        robots = ", ".join(str(i + 1) for i in blocked[:6])
        more = ", …" if len(blocked) > 6 else ""
        whose = "the berth of robot" if len(blocked) == 1 else "the berths of robots"
        notes.append(
            f"the launch circle of {launch_radius_m:g} m around {whose} {robots}{more} "
            "reaches onto land: launch exactly at the berth"
        )
    return tuple(notes)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Site:
    """The water within reach of the start: the connected piece of the region that holds it."""

    piece: shapely.Polygon
    shore: shapely.Geometry
    open_water: shapely.Geometry
    start: FloatArray
    reach: float
    launch_radius_m: float

    @classmethod
    def of(
        cls,
        water_m: shapely.Geometry,
        region_part_m: shapely.Polygon,
        start: FloatArray,
        reach: float,
        launch_radius_m: float,
    ) -> _Site:
        x, y = start
        near = shapely.box(x - reach, y - reach, x + reach, y + reach)
        wide = near.buffer(launch_radius_m + 1, join_style="mitre")
        pieces = [
            piece
            for piece in shapely.get_parts(region_part_m.intersection(near))
            if isinstance(piece, shapely.Polygon)
        ]
        if not pieces:  # the start on a corner that only touches the box
            pieces = [region_part_m]
        distance = shapely.distance(np.array(pieces, dtype=object), shapely.Point(start))
        piece = pieces[int(np.argmin(distance))]
        local = water_m.intersection(wide)
        # the edges of the box are no shore
        shore = water_m.boundary.intersection(wide)
        open_water = local.buffer(-launch_radius_m * 1.01).intersection(piece)
        shapely.prepare(piece)
        shapely.prepare(shore)
        return cls(
            piece=piece,
            shore=shore,
            open_water=open_water,
            start=start,
            reach=reach,
            launch_radius_m=launch_radius_m,
        )

    def choose(
        self, count: int, spacing: float, *, open_water: bool
    ) -> tuple[FloatArray, BoolArray] | None:
        """Return `count` points at least `spacing` apart, or None where they do not fit."""
        if open_water:
            if self.open_water.is_empty:
                return None
            first = shapely.get_coordinates(
                shapely.shortest_line(shapely.Point(self.start), self.open_water)
            )[1]
        else:
            first = self.start
        # 1e-6: neighbours on the lattice must not fail by rounding
        for pitch, border in ((spacing * (1 + 1e-6), False), (spacing / 4, True)):
            points = self._candidates(first, pitch, border=border, open_water=open_water)
            free = self._launch_free(points)
            if open_water:
                points, free = points[free], free[free]
            distance = np.round(np.hypot(*(points - self.start).T), 6)
            order = np.lexsort((points[:, 1], points[:, 0], distance, ~free))
            kept = _apart(points[order], spacing, count)
            if len(kept) == count:
                return points[order][kept], free[order][kept]
        return None

    def _candidates(
        self, first: FloatArray, pitch: float, *, border: bool, open_water: bool
    ) -> FloatArray:
        """Return lattice points in the piece, with `first`, and points on the border if asked."""
        rows = math.ceil(2 * self.reach / (pitch * math.sqrt(0.75))) + 1
        columns = math.ceil(2 * self.reach / pitch) + 1
        limit = 120  # a fine lattice over a long row of berths: the nearest are enough
        rows, columns = min(rows, limit), min(columns, limit)
        j, i = np.mgrid[-rows : rows + 1, -columns : columns + 1]
        along = (i + (j % 2) / 2) * pitch
        across = j * pitch * math.sqrt(0.75)
        tangent = self._shore_tangent()
        normal = np.array([-tangent[1], tangent[0]])
        points = first + along.ravel()[:, None] * tangent + across.ravel()[:, None] * normal
        points = points[np.abs(points - self.start).max(axis=1) <= self.reach]
        points = points[shapely.contains_xy(self.piece, points[:, 0], points[:, 1])]
        out = [first[None, :], points]
        if border:
            place = self.open_water if open_water else self.piece
            for ring in shapely.get_parts(shapely.get_rings(shapely.get_parts(place))):
                steps = int(np.clip(math.ceil(ring.length / pitch), 3, 4000))
                on_ring = shapely.line_interpolate_point(
                    ring, np.arange(steps) * (ring.length / steps)
                )
                out.append(shapely.get_coordinates(on_ring))
        return np.vstack(out)

    def _shore_tangent(self) -> FloatArray:
        """Return the direction of the region's border nearest to the start."""
        border = self.piece.exterior
        at = border.project(shapely.Point(self.start))
        a, b = (border.interpolate(d % border.length) for d in (at - 2.0, at + 2.0))
        step = np.array([b.x - a.x, b.y - a.y])
        length = float(np.hypot(*step))
        return step / length if length > 0.1 else np.array([1.0, 0.0])

    def _launch_free(self, points: FloatArray) -> BoolArray:
        """Tell which points have their launch circle wholly in the water."""
        if self.shore.is_empty:
            return np.ones(len(points), dtype=bool)
        limit = self.launch_radius_m - LAUNCH_TOLERANCE_M
        near: BoolArray = shapely.dwithin(shapely.points(points), self.shore, limit)
        return ~near


def _apart(points: FloatArray, spacing: float, count: int) -> list[int]:
    """Return the first `count` points, taken in order, that keep `spacing` from those before."""
    kept: list[int] = []
    allowed = np.ones(len(points), dtype=bool)
    limit2 = (spacing * (1 - 1e-9)) ** 2
    position = 0
    while len(kept) < count:
        ahead = np.flatnonzero(allowed[position:])
        if not len(ahead):
            break
        index = position + int(ahead[0])
        kept.append(index)
        allowed &= ((points - points[index]) ** 2).sum(axis=1) >= limit2
        position = index + 1
    return kept
