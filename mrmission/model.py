"""The dataclasses that cross a stage border, and nothing else.

Conventions
-----------
* Positions are arrays of shape ``(n, 2)``, ``[east_m, north_m]``, in a :class:`LocalFrame`;
  arrays of longitude and latitude say so in their name (``_lonlat``, degrees).
* The *sweep frame* is the local frame turned about its origin so that lanes run along its second
  axis: sweep coordinates are ``[across_m, along_m]``. A *column* is a strip of the sweep frame of
  width ``column_pitch_m``; a *row* a strip of height ``row_pitch_m``. Grids are indexed
  ``[column, row]``, so a column (one sweep line) is contiguous in memory.
* Arrays inside a dataclass are read-only.
"""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]


def read_only(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return `array` with its writeable flag cleared (no copy)."""
    array.setflags(write=False)
    return array


# --- area ----------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class OccupancyGrid:
    """Raster of a region: True where free.

    ``free[column, row]`` is the cell whose lower-left corner lies at
    ``origin_m + [column * column_pitch_m, row * row_pitch_m]``. Free cells are connected through
    edges (4-connectivity), never through corners.
    """

    free: BoolArray
    column_pitch_m: float
    row_pitch_m: float
    origin_m: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyArea:
    """What the user gave: water with islands, lon/lat degrees (WGS 84).

    ``water_lonlat`` is valid, its parts are disjoint, longitudes are continuous (they may leave
    ±180 where the water crosses the antimeridian). ``notes`` lists every repair and assumption,
    one line each, to be shown to the user.
    """

    name: str
    source: str
    water_lonlat: shapely.MultiPolygon
    notes: tuple[str, ...] = ()
    image: OccupancyGrid | None = None


# --- decomposition -------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, kw_only=True)
class Slices:
    """Runs of free cells, sorted by column, then by row.

    ``row_start``/``row_stop`` (half open) are what a raster of the same pitch would give: a cell is
    free when its centre is free. ``offsets[c]:offsets[c + 1]`` are the slices of column ``c``.
    """

    column: npt.NDArray[np.int32]
    row_start: npt.NDArray[np.int32]
    row_stop: npt.NDArray[np.int32]
    offsets: IntArray
    column_pitch_m: float
    row_pitch_m: float
    origin_m: tuple[float, float]

    def __len__(self) -> int:
        return len(self.column)


@dataclass(frozen=True, slots=True, kw_only=True)
class Cells:
    """Boustrophedon cells: chains of slices, one per column, between two critical points.

    The slices of cell ``i`` are ``slice_index[offsets[i]:offsets[i + 1]]``, by rising column.
    """

    slice_index: IntArray
    offsets: IntArray
    area_m2: FloatArray
    width_m: FloatArray
    centroid_m: FloatArray

    def __len__(self) -> int:
        return len(self.area_m2)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReebGraph:
    """Multigraph: node = critical point (sweep frame, m), edge ``i`` = cell ``i``.

    ``tail`` is the node at the cell's first column, ``head`` at its last. ``w_c`` is the coverage
    weight (area, m²), ``w_t`` the travel weight (m, along the cell's slice middles from node to
    node), ``c_e`` = width²/area, the matching weight of ECC.
    """

    node_m: FloatArray
    tail: IntArray
    head: IntArray
    w_c: FloatArray
    w_t: FloatArray
    c_e: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Decomposition:
    """Slices, cells, Reeb graph and dual graph of one region."""

    slices: Slices
    cells: Cells
    reeb: ReebGraph
    dual_edges: IntArray
    """(n, 2) pairs of cells that share a critical point, each pair once, smaller first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PostmanTour:
    """Closed walk over the edges (cells) of a Reeb graph, each once or twice.

    Step ``i`` goes along cell ``edge[i]`` from ``node[i]`` to ``node[i + 1]``; ``direction[i]`` is
    +1 from tail to head, -1 back. ``copy[i]`` is 0 for a cell that is walked once, 1 and 2 for the
    first and the second walk of a doubled one. ``doubled`` are the doubled cells, rising.
    """

    edge: IntArray
    direction: npt.NDArray[np.int8]
    copy: npt.NDArray[np.int8]
    node: IntArray
    doubled: IntArray

    def __len__(self) -> int:
        return len(self.edge)


# --- tours ---------------------------------------------------------------------------------------


class LegKind(enum.IntEnum):
    """What a leg is for."""

    TRANSIT = 0
    SURVEY = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class CoveragePath:
    """One robot's way from home to home.

    ``points_m`` has shape ``(n, 2)``; leg ``i`` runs from point ``i`` to ``i + 1``.
    ``kind[i]`` is a :class:`LegKind`, ``lane[i]`` the number of the lane within this robot's tour,
    counted from 1, 0 on a transit. A robot without work has one point, its home.
    """

    robot: int
    points_m: FloatArray
    kind: npt.NDArray[np.int8]
    lane: IntArray
    sortie: int = 1
    """Which of the robot's trips this is, from 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionItem:
    """One MAVLink MISSION_ITEM_INT of a mission; ``x``/``y`` are lat/lon in 1e-7 degrees."""

    seq: int
    frame: int
    command: int
    current: int
    autocontinue: int
    param1: float
    param2: float
    param3: float
    param4: float
    x: int
    y: int
    z: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FencePolygon:
    """One fence polygon: ``points_e7`` is (n, 2) int ``[lat, lon]`` in 1e-7 degrees, not closed."""

    inclusion: bool
    points_e7: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class RallyPoint:
    """A rally point, lat/lon in 1e-7 degrees, altitude in metres above home."""

    lat_e7: int
    lon_e7: int
    altitude_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LineReport:
    """A stretch of a mission along one survey line.

    ``kind`` is lane, fairway, shore, tie or extra. It begins on the way from item ``from_item`` on
    and ends on the way to ``to_item``, both included; ``bearing_deg`` is that from its start to its
    end as it is swept, None where it ends where it starts. ``length_m`` leaves out detours.
    """

    name: str
    kind: str
    robot: int
    sortie: int
    from_item: int
    to_item: int
    start_lonlat: tuple[float, float]
    end_lonlat: tuple[float, float]
    length_m: float
    bearing_deg: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class TieReport:
    """How tie lines meet the lines they check.

    ``crossings`` are pairs of a tie line and a lane or lap that meet, ``fewest`` those of the tie
    line that has fewest. ``lanes_crossed`` of all ``lanes`` meet a tie line; laps are not counted.
    """

    ties: int
    length_m: float
    lanes_m: float
    crossings: int
    fewest: int
    lanes: int
    lanes_crossed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Mission:
    """Everything one vehicle gets for one sortie: items (seq 0 is home), fence, rally points.

    ``kind``/``lane`` describe the leg that ends at each item (aligned with ``items``; lane 0 and
    TRANSIT for home, commands and transits) for the map and the report; they are not sent.
    """

    robot: int
    sortie: int
    vehicle: str
    items: tuple[MissionItem, ...]
    fence: tuple[FencePolygon, ...]
    rally: tuple[RallyPoint, ...]
    kind: tuple[int, ...] = ()
    lane: tuple[int, ...] = ()
    lines: tuple[LineReport, ...] = ()
    """The stretches along survey lines in order: lane ``n`` is ``lines[n - 1]``."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SortieReport:
    """One trip of a robot, from home to home.

    ``endurance_used`` is the share of the endurance, reserve included, that it takes; None for a
    robot whose endurance is not given. ``start_s`` is when it begins, after the robot's start.
    """

    sortie: int
    length_m: float
    survey_m: float
    transit_m: float
    duration_s: float
    items: int
    lanes: int
    fence_points: int
    fence_land_m2: float
    start_s: float = 0.0
    endurance_used: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotReport:
    """One row of the table: all trips of a robot together.

    ``duration_s`` ends with the last trip and counts the time between trips; ``items`` and
    ``lanes`` are those of all trips, ``fence_points`` and ``fence_land_m2`` the largest of one.
    """

    robot: int
    start_lonlat: tuple[float, float]
    length_m: float
    survey_m: float
    transit_m: float
    duration_s: float
    items: int
    lanes: int
    fence_points: int
    fence_land_m2: float
    start_delay_s: float = 0.0
    """Seconds after the fleet's start at which the robot starts, to keep clear of the others."""
    name: str = ""
    """What people call it, where a fleet file says so."""
    sorties: tuple[SortieReport, ...] = ()

    @property
    def trips(self) -> tuple[SortieReport, ...]:
        """Return the robot's trips; a row that tells of none is one trip itself."""
        if self.sorties:
            return self.sorties
        own = {f.name for f in fields(SortieReport)} & {f.name for f in fields(self)}
        return (SortieReport(sortie=1, **{name: getattr(self, name) for name in own}),)


@dataclass(frozen=True, slots=True, kw_only=True)
class StraightReturn:
    """Where one robot's straight way home (return to launch) leaves the water.

    ``share_over_land`` of its way, the longest stretch over land, and the place on the way where
    that one begins (None where every way home stays in the water). ``farthest_m`` is how far from
    home it gets, ``fence_action`` the FENCE_ACTION that suits it.
    """

    robot: int
    share_over_land: float
    longest_over_land_m: float
    worst_lonlat: tuple[float, float] | None
    farthest_m: float
    fence_action: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FailsafeReport:
    """What the vehicles do at a breach or a failsafe; empty for vehicles that fly."""

    straight_returns: tuple[StraightReturn, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class PairDistance:
    """How near two robots can come while both are under way; None: never under way together."""

    robots: tuple[int, int]
    least_m: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class SeparationConflict:
    """A place where two robots can come nearer than the separation.

    ``least_m`` is how near, ``from_s`` to ``to_s`` when, after the fleet's start; ``chance`` is the
    share of the time errors allowed for that bring it about. ``at_berths``: near their own homes.
    """

    robots: tuple[int, int]
    least_m: float
    lonlat: tuple[float, float]
    from_s: float
    to_s: float
    chance: float
    at_berths: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SeparationReport:
    """How far apart the robots of a fleet stay; a ``distance_m`` of 0: it was not looked at.

    ``turned`` are the robots that sail their tour the other way round for it, ``regions`` the
    number of connected pieces of each robot's lanes, ``crossings_m`` the length of its transits
    that lies in other robots' regions; both in the order of the report's rows.
    """

    distance_m: float = 0.0
    time_share: float = 0.0
    start_slack_s: float = 0.0
    max_delay_s: float = 0.0
    turned: tuple[int, ...] = ()
    pairs: tuple[PairDistance, ...] = ()
    conflicts: tuple[SeparationConflict, ...] = ()
    regions: tuple[int, ...] = ()
    crossings_m: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetReport:
    """Every number of the table; ``report.json`` is this, field by field.

    ``lower_bound_s`` holds for any plan whatever, ``lanes_bound_s`` for all plans that sweep the
    chosen lines (None where the planner knows none); the names say which term of each is the
    largest, the gaps are makespan over bound, minus 1.
    """

    robots: tuple[RobotReport, ...]
    method: str
    makespan_s: float
    lower_bound_s: float
    lower_bound_name: str
    gap: float
    utilization: float
    coverage: float
    coverage_survey_legs: float
    coverage_of_area: float
    largest_missed_m2: float
    area_m2: float
    navigable_m2: float
    unreached_m2: float
    unreached_parts_m2: tuple[float, ...]
    angle_deg: float
    lane_spacing_m: float
    frame: str
    frame_error_m: float
    options: Mapping[str, Any]
    assumed: Mapping[str, Any]
    notes: tuple[str, ...]
    versions: Mapping[str, str]
    seed: int
    failsafe: FailsafeReport = FailsafeReport()
    lanes_bound_s: float | None = None
    lanes_bound_name: str = ""
    lanes_gap: float | None = None
    lines: tuple[LineReport, ...] = ()
    tie_lines: TieReport | None = None
    separation: SeparationReport = SeparationReport()


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetPlan:
    """The result of :func:`mrmission.pipeline.plan`: what `plan` writes and `upload` sends.

    ``water_m`` is the whole survey area, ``region_m`` the navigable region that was planned, both
    in the local frame whose PROJ string is ``report.frame``.
    """

    area: SurveyArea
    water_m: shapely.MultiPolygon
    region_m: shapely.MultiPolygon
    homes_m: FloatArray
    paths: tuple[CoveragePath, ...]
    missions: tuple[Mission, ...]
    report: FleetReport
    cells_m: tuple[shapely.Polygon, ...] = field(default=())
