"""Tie lines: lines across the lanes that check them against each other.

Where a tie line crosses a lane the same place is measured twice, by another pass and mostly at
another time: what disagrees is an error of depth, tide, position or sound speed. Tie lines are
swept in addition to the lanes and cover nothing by themselves.

References
----------
NOAA, Hydrographic Survey Specifications and Deliverables: cross lines of at least 4 % of the
mainscheme's length for multibeam surveys, 8 % where lines lie apart (single beam, set line
spacing), spread over the whole area, crossing the mainscheme at 45 to 90 degrees.
IHO, Standards for Hydrographic Surveys, S-44: cross lines as a check of a survey's uncertainty;
its fourth edition (1998) has them no more than 15 line spacings apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from mrmission.decomposition.slices import lane_intervals
from mrmission.errors import InfeasibleError
from mrmission.model import FloatArray, IntArray, TieReport
from mrmission.tour.lines import LineKind, SurveyLine, geometry_of, lengths_m, row_names
from mrmission.tour.sweep import SweepFrame
from mrmission.tour.tie_spec import TieSpec

MAX_ROWS = 10_000


def tie_lines(
    region_m: shapely.Polygon, bearing_deg: float, lanes: Sequence[SurveyLine], spec: TieSpec
) -> tuple[SurveyLine, ...]:
    """Return tie lines at right angles to the lanes, over the whole region, cut at land.

    Rows lie evenly along the lanes' bearing, the first and the last half a spacing from the ends
    of the region. A piece of a row that crosses no lane checks nothing and is left out.

    Parameters
    ----------
    region_m
        Navigable region, local frame.
    bearing_deg
        Of the lanes.
    lanes
        The lines to be checked: lanes and shore laps.
    spec
        How many: for a share the fewest rows whose lines are at least that long in all; for
        a spacing the fewest rows that lie no farther apart.

    Returns
    -------
    tuple of SurveyLine
        T1, T2, … by row along the bearing; T2a, T2b, … where land cuts a row.

    Raises
    ------
    InfeasibleError
        When no tie line crosses a lane, or the share can't be reached.
    """
    frame = SweepFrame(bearing_deg=(bearing_deg + 90.0) % 360.0)
    region = frame.turn(region_m)
    tree = shapely.STRtree(geometry_of(lanes))
    # Across the turned frame's first axis lie the rows; its order along the lanes' bearing is
    # the reverse: a bearing 90 degrees on has its "across" to where the lanes come from.
    x_min, _, x_max, _ = region.bounds
    if spec.spacing_m is not None:
        rows = max(1, int(np.ceil((x_max - x_min) / spec.spacing_m - 1e-9)))
        if rows > MAX_ROWS:
            raise InfeasibleError(
                f"--tie-lines {spec}: makes {rows} rows, more than {MAX_ROWS}: "
                "choose a wider spacing"
            )
        found = _rows(region, frame, rows, tree)
    else:
        assert spec.share is not None
        goal_m = spec.share * float(lengths_m(lanes).sum())
        found = _rows_of_length(region, frame, goal_m, tree, spec)
    if not found:
        raise InfeasibleError(
            f"--tie-lines {spec}: no tie line crosses a lane: choose more tie lines"
        )
    return found


def _rows_of_length(
    region: shapely.Geometry, frame: SweepFrame, goal_m: float, tree: shapely.STRtree, spec: TieSpec
) -> tuple[SurveyLine, ...]:
    """Return the fewest rows whose lines have the length in all."""
    x_min, _, x_max, _ = region.bounds
    # rows together are about area over spacing long: begin a little below that many
    about = goal_m * (x_max - x_min) / max(float(region.area), 1e-9)
    rows = max(1, int(0.7 * about))
    while rows <= min(MAX_ROWS, 20 + 4 * int(about)):
        found = _rows(region, frame, rows, tree)
        if lengths_m(found).sum() >= goal_m:
            # rows before the first guess might do, where the shape is odd
            while rows > 1:
                fewer = _rows(region, frame, rows - 1, tree)
                if lengths_m(fewer).sum() < goal_m:
                    break
                rows, found = rows - 1, fewer
            return found
        rows += 1
    raise InfeasibleError(
        f"--tie-lines {spec}: {goal_m:.0f} m of tie lines don't fit the region: choose fewer"
    )


def _rows(
    region: shapely.Geometry, frame: SweepFrame, rows: int, tree: shapely.STRtree
) -> tuple[SurveyLine, ...]:
    """Return the tie lines of evenly spaced rows that cross a lane, named."""
    x_min, _, x_max, _ = region.bounds
    # falling: row 1 is the first along the lanes' bearing
    x = x_max - (np.arange(rows) + 0.5) * (x_max - x_min) / rows
    row, low, high = lane_intervals(region, x)
    ends = np.stack([np.column_stack([x[row], low]), np.column_stack([x[row], high])], axis=1)
    ways = frame.to_local(ends)
    hits = tree.query(shapely.linestrings(ways), predicate="intersects")[0] if len(ways) else []
    kept = np.unique(np.asarray(hits, dtype=np.int64))
    return _named(ways[kept], row[kept])


def _named(ways: FloatArray, row: IntArray) -> tuple[SurveyLine, ...]:
    """Return tie lines named by the rows that have any, numbered from 1."""
    names = row_names("T", np.unique(row, return_inverse=True)[1] + 1)
    return tuple(
        SurveyLine(points_m=way, kind=LineKind.TIE, name=name)
        for way, name in zip(ways, names, strict=True)
    )


def crossings(lines: Sequence[SurveyLine]) -> TieReport:
    """Return how the tie lines among `lines` meet the others."""
    ties = [line for line in lines if line.kind is LineKind.TIE]
    checked = [line for line in lines if line.kind is not LineKind.TIE]
    lane = np.array([line.kind is LineKind.LANE for line in checked], dtype=bool)
    tree = shapely.STRtree(geometry_of(checked))
    which, other = tree.query(np.array(geometry_of(ties), dtype=object), predicate="intersects")
    met = np.unique(other)
    return TieReport(
        ties=len(ties),
        length_m=float(lengths_m(ties).sum()),
        lanes_m=float(lengths_m(checked).sum()),
        crossings=len(which),
        fewest=int(np.bincount(which, minlength=len(ties)).min()) if ties else 0,
        lanes=int(lane.sum()),
        lanes_crossed=int(lane[met].sum()),
    )
