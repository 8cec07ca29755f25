"""Sorties: where a robot's work is more than one battery or one memory holds, it goes out again.

A trip is a robot of its own to the planner of lanes: one that lives at the berth of the robot that
makes it. So the trips of the whole fleet are searched for together, the longest as short as can be,
and robots of different endurance weigh their seconds differently. How many trips each robot makes
grows until they fit: next comes the robot whose trips would be over first.

The methods that share out cells give every robot its tour, and that tour is cut between lanes. So
are the trips that turn out too long once everything is covered, and those of too many items.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from mrmission.area.frame import LocalFrame
from mrmission.errors import InfeasibleError, PlanningError
from mrmission.minmax.trips import Allowance, Gauge, TooFarError, TripCutter, cut_line, may_hold
from mrmission.mission.build import Route
from mrmission.mission.items import count_items
from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.stages.export import Coverage, export_part
from mrmission.tour.lines import SurveyLine, lengths_m
from mrmission.tour.path import join_pieces
from mrmission.tour.turnaround import with_turnarounds
from mrmission.tour.work import PartPlan, PartTours, PartWork

Planner = Callable[[PartWork], PartTours]
MOST_TRIPS = 400
ROUNDS = 12
"""How often trips are cut anew because covering everything made one too long."""
ANEW_ROUNDS = 2
"""How often all trips are planned anew for that; then those that are too long are cut."""
LEAST_ROOM = 0.85
"""Trips are planned anew while they may be filled so far; else too many would be half empty."""
QUICK_SHARE = 0.15
"""Of the time budget, to find out whether a number of trips may do."""
HOPE = 1.04
"""A quick search that misses by no more than this factor is worth a thorough one."""
LEAST_SHARE = 0.25
"""Trips of a robot are planned for no less of its endurance than this."""
ROOM = 1.03
"""What is said to be enough has so much room for what covers the rest."""
MARGIN = 0.995
"""Where covering the rest made a trip too long, the next is planned a little shorter than it must
be."""


def export_in_sorties(
    whole: PartPlan, frame: LocalFrame, planner: Planner | None
) -> tuple[PartPlan, list[Route], Coverage]:
    """Return a part's routes, cut into as many trips as endurance and memory ask for.

    Parameters
    ----------
    whole
        With one tour for each robot.
    frame
        Local frame of the plan.
    planner
        What shares out lines among trips; None where the tours themselves are cut.

    Returns
    -------
    part
        The same where every robot is home in time; otherwise its robots come once for each of
        their trips, in order (:func:`numbers_of` tells which is which).
    routes, coverage
        Of its paths, as :func:`mrmission.stages.export.export_part` returns them.

    Raises
    ------
    InfeasibleError
        When a place cannot be reached and returned from: names it, and what would do.
    PlanningError
        When no number of trips covers everything.
    """
    sorties = Sorties(whole, planner)
    try:
        allowed = [1.0] * len(whole.work.robots)
        part = whole if max(sorties.planned(whole)) <= 1.0 else sorties.trips(allowed)
        for attempt in range(ROUNDS):
            routes, coverage = export_part(part, frame)
            measured = sorties.measured(part, routes)
            if max(measured) <= 1.0:
                return part, routes, coverage
            planned = sorties.planned(part)
            room = sorties.room(part, planned, measured)
            if attempt < ANEW_ROUNDS and min(room) >= LEAST_ROOM:
                # What covers the rest came on top: leave room for it, and plan all trips anew.
                allowed = [min(a, r) for a, r in zip(allowed, room, strict=True)]
                part = sorties.trips(allowed)
            else:
                part = sorties.shortened(sorties.complete(part, routes), measured)
    except TooFarError as error:
        raise InfeasibleError(sorties.explain(error, frame)) from error
    raise PlanningError(
        "covering everything takes more than the trips hold: choose another --angle, a larger "
        "--endurance or --max-items"
    )


def numbers_of(part: PartPlan) -> list[tuple[int, int]]:
    """Return robot and sortie, both from 1, of each path of a part."""
    seen: dict[int, int] = {}
    out = []
    for robot in part.work.robots:
        seen[robot] = seen.get(robot, 0) + 1
        out.append((robot, seen[robot]))
    return out


def joined(routes: Sequence[Route]) -> Route:
    """Return the trips of one robot as one route that comes home in between."""
    if len(routes) == 1:
        return routes[0]
    first = routes[0].path
    lanes, before = [], 0
    for route in routes:
        lane = route.path.lane
        lanes.append(np.where(lane > 0, lane + before, 0))
        before += int(lane.max(initial=0))
    rest = routes[1:]
    return Route(
        lonlat=np.concatenate([routes[0].lonlat, *(r.lonlat[1:] for r in rest)]),
        path=replace(
            first,
            points_m=np.concatenate([first.points_m, *(r.path.points_m[1:] for r in rest)]),
            kind=np.concatenate([r.path.kind for r in routes]),
            lane=np.concatenate(lanes),
        ),
    )


def parted(route: Route, legs: Sequence[int], turned: bool) -> list[Route]:
    """Return a joined route as trips again.

    Parameters
    ----------
    route
        What :func:`joined` made, or the same the other way round.
    legs
        How many legs each trip has, as they were joined.
    turned
        Whether it is the other way round: then the last trip comes first.
    """
    out, at = [], 0
    for count in reversed(legs) if turned else legs:
        lane = route.path.lane[at : at + count]
        offset = int(lane[lane > 0].min(initial=np.iinfo(np.int64).max)) - 1
        out.append(
            Route(
                lonlat=route.lonlat[at : at + count + 1],
                path=replace(
                    route.path,
                    points_m=route.path.points_m[at : at + count + 1],
                    kind=route.path.kind[at : at + count],
                    lane=np.where(lane > 0, lane - offset, 0),
                ),
            )
        )
        at += count
    return out


class Sorties:
    """Cuts the work of one part into trips.

    Parameters
    ----------
    whole
        The part with one tour for each robot.
    planner
        What shares out lines among trips, if anything does.
    """

    def __init__(self, whole: PartPlan, planner: Planner | None) -> None:
        self.whole = whole
        self.work = whole.work
        self._planner = planner
        self._row = {robot: i for i, robot in enumerate(self.work.robots)}
        self._own = [self.work.options.of_robot(robot) for robot in self.work.robots]
        self.gauges = [
            Gauge(allowance=Allowance.of(own), time=time, options=own, shaped=_shape(self.work))
            for own, time in zip(self._own, self.work.times, strict=True)
        ]

    @property
    def searches(self) -> bool:
        """Return whether trips are searched for, and not only cut from the tours."""
        return self._planner is not None and not all(g.allowance.endless for g in self.gauges)

    def planned(self, part: PartPlan) -> list[float]:
        """Return what each path uses of its robot's allowance, before the rest is covered."""
        return [
            self.gauges[self._row[robot]].used(path)
            for robot, path in zip(part.work.robots, part.tours.paths, strict=True)
        ]

    def measured(self, part: PartPlan, routes: Sequence[Route]) -> list[float]:
        """Return what each route uses of its robot's allowance, as it is exported."""
        return [
            replace(self.gauges[self._row[robot]], shaped=_as_it_is).used(route.path)
            for robot, route in zip(part.work.robots, routes, strict=True)
        ]

    def room(
        self, part: PartPlan, planned: Sequence[float], measured: Sequence[float]
    ) -> list[float]:
        """Return how far each robot's trips may be filled for the longest to fit once complete."""
        out = [1.0] * len(self.work.robots)
        for robot, before, after in zip(part.work.robots, planned, measured, strict=True):
            row = self._row[robot]
            if after > 1.0:
                out[row] = min(out[row], MARGIN * min(1.0, before / after))
        return out

    def trips(self, allowed: Sequence[float]) -> PartPlan:
        """Return the part with trips that use at most a share of what they may.

        Parameters
        ----------
        allowed
            The share, for each robot.

        Raises
        ------
        TooFarError
            When a place cannot be reached and returned from.
        """
        if not self.searches:
            return self._plan_of(self._cut_tours(allowed))
        found = self._search(allowed)
        planned = self.planned(found)
        if max(planned) > 1.0:  # of too many items
            found = self.shortened(found, planned)
        return found

    def shortened(self, part: PartPlan, measured: Sequence[float]) -> PartPlan:
        """Return the part with the trips that use more than they may cut into more trips.

        Parameters
        ----------
        part
            With trips.
        measured
            What each uses of its allowance.
        """
        out: list[list[CoveragePath]] = [[] for _ in self.work.robots]
        planned = self.planned(part)
        rows = zip(part.work.robots, part.tours.paths, planned, measured, strict=True)
        for robot, path, before, after in rows:
            row = self._row[robot]
            if max(before, after) <= 1.0:
                out[row].append(path)
                continue
            try:
                allowed = MARGIN * min(1.0, before / after)
                out[row] += self._cutter(row, path, allowed).trips(2)
            except TooFarError:
                # so short they cannot be; in two will do for now
                out[row] += self._cutter(row, path, min(1.0, MARGIN * before)).trips(2)
        return self._plan_of(out)

    def complete(self, part: PartPlan, routes: Sequence[Route]) -> PartPlan:
        """Return the part with its paths as they are once all is covered.

        Where runs or turns of a radius have been added to the routes, these would be added twice:
        the paths then stay as planned.
        """
        if max(self.work.options.runs_m) > 0 or self.work.options.turn_radius_m > 0:
            return part
        paths = tuple(
            replace(route.path, robot=path.robot)
            for route, path in zip(routes, part.tours.paths, strict=True)
        )
        return replace(part, tours=replace(part.tours, paths=paths))

    # --- cutting tours ---------------------------------------------------------------------------

    def _cutter(self, row: int, path: CoveragePath, allowed: float) -> TripCutter:
        own = replace(path, robot=row + 1)
        return TripCutter(own, self._home_ways(row), self.gauges[row], allowed)

    def _home_ways(self, row: int) -> Callable[[FloatArray], list[FloatArray]]:
        return lambda points_m: self.work.harbour.home_paths([row] * len(points_m), points_m)

    def _cut_tours(self, allowed: Sequence[float]) -> list[list[CoveragePath]]:
        paths = self.whole.tours.paths
        return [self._cutter(row, path, allowed[row]).trips() for row, path in enumerate(paths)]

    def _plan_of(self, trips: Sequence[Sequence[CoveragePath]]) -> PartPlan:
        """Return the part with these trips of each robot."""
        owners = [row for row, mine in enumerate(trips) for _ in mine]
        paths = tuple(
            replace(path, robot=number)
            for number, path in enumerate((p for mine in trips for p in mine), start=1)
        )
        return PartPlan(work=self._work_of(owners), tours=replace(self.whole.tours, paths=paths))

    def _work_of(self, owners: Sequence[int]) -> PartWork:
        """Return the work with one robot for each trip."""
        work = self.work
        return replace(
            work,
            robots=tuple(work.robots[row] for row in owners),
            homes_m=work.homes_m[list(owners)],
            harbour=work.harbour.shared(list(owners)),
            times=tuple(work.times[row] for row in owners),
        )

    # --- searching for trips ---------------------------------------------------------------------

    def _search(self, allowed_of: Sequence[float]) -> PartPlan:
        """Return the part with as few trips as the search finds to fit."""
        allowed = min(allowed_of)
        lines = self._fitting_lines(allowed)
        cut: PartPlan | None = None
        # what is too far for the robot that has it now, another may reach
        with contextlib.suppress(TooFarError):
            cut = self._plan_of(self._cut_tours(allowed_of))
        most = MOST_TRIPS if cut is None else len(cut.work.robots)
        for counts in self._growing(most):
            if not self._may_hold(counts, allowed, lines):
                continue
            found = self._searched(counts, lines, QUICK_SHARE)
            if self._endurance_used(found) > HOPE * allowed:
                continue
            if QUICK_SHARE * self.work.options.time_budget_s > 0:
                found = self._searched(counts, lines, 1.0)
            if self._endurance_used(found) <= allowed:
                if cut is None or sum(counts) < len(cut.work.robots):
                    return found
                return min((found, cut), key=self._makespan_s)
        if cut is None:
            raise PlanningError(
                f"{MOST_TRIPS} trips do not hold the work: choose a larger --endurance"
            )
        return cut

    def _growing(self, most: int) -> Iterator[list[int]]:
        """Yield how many trips each robot makes, few first, until they are `most` in all."""
        counts = [1] * len(self.work.robots)
        while True:
            yield list(counts)
            if sum(counts) >= most:
                return
            after = [self._busy_s(row, counts[row] + 1) for row in range(len(counts))]
            first = min(after)
            if not math.isfinite(first):
                return
            for row, end in enumerate(after):
                if end <= first * (1 + 1e-9):
                    counts[row] += 1

    def _full_s(self, row: int) -> float:
        """Return how long a full trip of a robot takes, s."""
        allowance, own = self.gauges[row].allowance, self._own[row]
        return min(allowance.seconds, allowance.metres / own.survey_speed_m_s)

    def _busy_s(self, row: int, trips: int) -> float:
        """Return how long so many full trips of a robot take, s."""
        return trips * self._full_s(row) + (trips - 1) * self._own[row].swap_time_s

    def _weights(self, counts: Sequence[int]) -> FloatArray:
        """Return (robots, 2) how much a second of sweeping, and of travel, counts for each robot.

        Trips are weighed so that one that counts as much as the others is over in time for all its
        robot's trips to end when those of the others do.
        """
        rows = range(len(counts))
        end_s = min(self._busy_s(row, counts[row]) for row in rows)
        out = np.ones((len(counts), 2))
        for row in rows:
            own, count = self._own[row], counts[row]
            share_s = (end_s - (count - 1) * own.swap_time_s) / count
            full_s = self._full_s(row)
            if math.isfinite(full_s):
                share_s = max(share_s, LEAST_SHARE * full_s)
            by_way = math.isfinite(self.gauges[row].allowance.metres)
            out[row] = 1.0 / share_s
            out[row, 1] *= own.transit_speed_m_s / own.survey_speed_m_s if by_way else 1.0
        return out / out[0, 0]

    def _searched(
        self, counts: Sequence[int], lines: tuple[SurveyLine, ...], budget_share: float
    ) -> PartPlan:
        """Return the part with the trips of one search; trips without work are left out."""
        assert self._planner is not None
        owners = [row for row, count in enumerate(counts) for _ in range(count)]
        options = self.work.options
        weights = self._weights(counts)[owners]
        work = replace(
            self._work_of(owners),
            lines=lines,
            weights=None if np.all(weights == 1.0) else weights,
            options=replace(options, time_budget_s=budget_share * options.time_budget_s),
        )
        trips: list[list[CoveragePath]] = [[] for _ in counts]
        for row, path in zip(owners, self._planner(work).paths, strict=True):
            if len(path.kind) or not trips[row]:
                trips[row] = [p for p in trips[row] if len(p.kind)] + [path]
        return self._plan_of(trips)

    def _endurance_used(self, part: PartPlan) -> float:
        """Return the largest share of its endurance that a trip uses; items are not counted."""
        out = 0.0
        for robot, path in zip(part.work.robots, part.tours.paths, strict=True):
            gauge = self.gauges[self._row[robot]]
            battery = replace(gauge.allowance, items=math.inf)
            out = max(out, replace(gauge, allowance=battery).used(path))
        return out

    def _makespan_s(self, part: PartPlan) -> float:
        busy = [-own.swap_time_s for own in self._own]
        for robot, path in zip(part.work.robots, part.tours.paths, strict=True):
            row = self._row[robot]
            time = self.work.times[row]
            busy[row] += time.duration_s(path.points_m, path.kind) + self._own[row].swap_time_s
        return max(busy)

    def _may_hold(self, counts: Sequence[int], allowed: float, lines: Sequence[SurveyLine]) -> bool:
        """Return False where so many trips surely are too few."""
        room_m: list[float] = []
        for row, count in enumerate(counts):
            allowance = self.gauges[row].allowance
            longest = min(allowance.metres, allowance.seconds * self.work.times[row].top_speed_m_s)
            if math.isinf(longest):
                return True
            room_m += [allowed * longest] * count
        length, reach = lengths_m(lines), self._reach_m(lines)
        return may_hold(length, reach, room_m)

    def _reach_m(self, lines: Sequence[SurveyLine]) -> FloatArray:
        """Return (lines,) how far each line is from the nearest home in the water, at least."""
        ends = np.array([line.ends_m for line in lines]).reshape(-1, 2)
        away = self.work.harbour.distances(self.work.homes_m, ends).min(axis=0).reshape(-1, 2)
        # along a line the way home grows no faster than the line
        return np.maximum(0.0, 0.5 * (away.sum(axis=1) - lengths_m(lines)))

    def _fitting_lines(self, allowed: float) -> tuple[SurveyLine, ...]:
        """Return the lines, those that no robot holds on a trip cut into pieces."""
        row = max(range(len(self.gauges)), key=self._full_s)
        if self.gauges[row].allowance.endless:
            return self.work.lines
        out: list[SurveyLine] = []
        ways = self._home_ways(row)
        ends = np.array([line.ends_m for line in self.work.lines]).reshape(-1, 2)
        away = self.work.harbour.distances(self.work.homes_m[row : row + 1], ends)[0]
        reach = away.reshape(-1, 2).sum(axis=1)
        gauge = self.gauges[row]
        slowest = min(self._own[row].survey_speed_m_s, self._own[row].transit_speed_m_s)
        most = min(gauge.allowance.metres, gauge.allowance.seconds * slowest)
        for line, far_m in zip(self.work.lines, reach.tolist(), strict=True):
            if 1.5 * (far_m + line.length_m) < allowed * most:
                out.append(line)  # surely fits, corners and all
                continue
            there, back = ways(line.ends_m)
            alone = join_pieces(
                row + 1,
                [
                    (there, LegKind.TRANSIT, 0),
                    (line.points_m, LegKind.SURVEY, 1),
                    (back[::-1], LegKind.TRANSIT, 0),
                ],
            )
            cutter = TripCutter(alone, ways, gauge, allowed)
            if len(cutter) < 2:
                out.append(line)
            else:
                out += [replace(line, points_m=piece) for piece in cutter.lines_m]
        return tuple(out)

    # --- what cannot be done ---------------------------------------------------------------------

    def explain(self, error: TooFarError, frame: LocalFrame) -> str:
        """Return one line on a place that is too far: where, for whom, and what would do."""
        row = error.trip.robot - 1
        gauge, own = self.gauges[row], self._own[row]
        battery = replace(gauge, allowance=replace(gauge.allowance, items=math.inf))
        by_items = battery.used(error.trip) < MARGIN
        place, path = (error.place_m, error.trip) if by_items else self._farthest(row)
        lon, lat = frame.to_lonlat(place[None])[0]
        where = f"robot {self.work.robots[row]}: the water at {lon:.6f},{lat:.6f}"
        if by_items:
            need = count_items(gauge.shaped(path).kind, own)
            return (
                f"{where} takes {need} mission items there and back, and all must fit into "
                f"{gauge.allowance.items:.0f}; give a larger --max-items or a nearer --start"
            )
        kept = 1.0 - own.reserve
        if own.endurance_m is not None:
            step, unit, has = 10.0, "m", own.endurance_m
            need_m = replace(gauge, allowance=Allowance(metres=kept)).used(path)
            least = step * math.ceil(ROOM * need_m / step)
        else:
            step, unit, has = 60.0, "min", own.endurance_s or 0.0
            need_s = replace(gauge, allowance=Allowance(seconds=kept)).used(path)
            least = math.ceil(ROOM * need_s / step)
            has /= step
        return (
            f"{where} cannot be reached and returned from with an endurance of {has:g} {unit} less "
            f"a reserve of {own.reserve:.0%}; it takes an --endurance of {least:g}{unit}, "
            "a smaller --reserve or a nearer --start"
        )

    def _farthest(self, row: int) -> tuple[FloatArray, CoveragePath]:
        """Return the place on the lines that is farthest from a robot's home, and a trip to it."""
        lines = [line.points_m for line in self.work.lines]
        step_m = self.work.options.swath_m
        pieces = [p for line in lines for p in cut_line(line, max(1, math.ceil(_m(line) / step_m)))]
        ends = np.array([piece[[0, -1]] for piece in pieces]).reshape(-1, 2)
        home = self.work.homes_m[row : row + 1]
        away = self.work.harbour.distances(home, ends)[0].reshape(-1, 2).sum(axis=1)
        piece = pieces[int(np.argmax(away))]
        there, back = self._home_ways(row)(piece[[0, -1]])
        legs = [
            (there, LegKind.TRANSIT, 0),
            (piece, LegKind.SURVEY, 1),
            (back[::-1], LegKind.TRANSIT, 0),
        ]
        return piece.mean(axis=0), join_pieces(row + 1, legs)


def _m(line_m: FloatArray) -> float:
    return float(np.hypot(*np.diff(line_m, axis=0).T).sum())


def _as_it_is(path: CoveragePath) -> CoveragePath:
    return path


def _shape(work: PartWork) -> Callable[[CoveragePath], CoveragePath]:
    """Return what becomes of a path before it is exported."""
    options = work.options
    run_in_m, run_out_m = options.runs_m
    if max(run_in_m, run_out_m) <= 0:
        return _as_it_is
    limits = None if options.vehicle == "copter" else work.region_m
    return lambda path: with_turnarounds(path, run_in_m, limits, run_out_m)
