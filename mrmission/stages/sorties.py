"""Sorties: where a robot's work is more than one battery or one memory holds, it goes out again.

The planner of lanes searches for the trips of all robots (:mod:`mrmission.stages.trip_search`). The
methods that share out cells give every robot its tour, and that tour is cut between lanes. So
are the trips that turn out too long once everything is covered, and those of too many items.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from mrmission.area.frame import LocalFrame
from mrmission.errors import InfeasibleError, PlanningError
from mrmission.minmax.trips import TooFarError
from mrmission.mission.build import Route
from mrmission.model import CoveragePath
from mrmission.stages.export import Coverage, export_part
from mrmission.stages.item_shares import items_shared_out
from mrmission.stages.too_far import explain_too_far
from mrmission.stages.trip_search import Planner, TripSearch
from mrmission.stages.trip_work import TripWork
from mrmission.tour.work import PartPlan

ROUNDS = 12
"""How often trips are cut anew because covering everything made one too long."""
ANEW_ROUNDS = 2
"""How often all trips are planned anew for that; then those that are too long are cut."""
LEAST_ROOM = 0.85
"""Trips are planned anew while they may be filled so far; else too many would be half empty."""
MARGIN = 0.995
"""Where covering the rest made a trip too long, the next is planned a little shorter than it must
be."""

ITEMS_ROOM = 0.95
"""Tours of more items than memory holds are cut into trips that fill it so far: covering the rest
takes some, and looking at everything once more is dear."""


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
        their trips, in order.
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
        planned = sorties.base.planned(whole)
        allowed = sorties.first_room(planned)
        part, shared = whole, None
        if max(planned) > 1.0:
            shared = sorties.shared_out(ITEMS_ROOM)
            part = shared or sorties.trips(allowed)
        for attempt in range(ROUNDS):
            routes, coverage = export_part(part, frame, fits=partial(sorties.base.fit, part))
            if coverage is not None:
                return part, routes, coverage
            measured = sorties.base.measured(part, routes)
            if part is shared:  # it fitted, but not with what covers the rest: trips after all
                shared, part = None, sorties.trips(allowed)
                continue
            planned = sorties.base.planned(part)
            room = sorties.room(part, planned, measured)
            shared = sorties.shared_out(min(ITEMS_ROOM, *room)) if part is whole else None
            if shared is not None:
                part = shared
            elif attempt < ANEW_ROUNDS and min(room) >= LEAST_ROOM:
                # What covers the rest came on top: leave room for it, and plan all trips anew.
                allowed = [min(a, r) for a, r in zip(allowed, room, strict=True)]
                part = sorties.trips(allowed)
            else:
                longer, part = part, sorties.shortened(sorties.complete(part, routes), measured)
                if len(part.work.robots) == len(longer.work.robots):
                    break  # none of them can be cut: what covers the rest is too much for one
    except TooFarError as error:
        raise InfeasibleError(explain_too_far(sorties.base, error, frame)) from error
    raise PlanningError(
        "covering everything takes more than the trips hold: choose another --angle, a larger "
        "--endurance or --max-items"
    )


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
        self.base = TripWork(whole)
        self._planner = planner

    def shared_out(self, room: float) -> PartPlan | None:
        """Return the part with the items of its tours shared out, where that does instead of trips.

        Parameters
        ----------
        room
            How far memories may be filled.
        """
        if self._planner is None:
            return None
        return items_shared_out(self.base, self._planner, room)

    def first_room(self, planned: Sequence[float]) -> list[float]:
        """Return how far trips may be filled at first, by what each whole tour uses."""
        return [ITEMS_ROOM if self.base.endless and share > 1.0 else 1.0 for share in planned]

    def room(
        self, part: PartPlan, planned: Sequence[float], measured: Sequence[float]
    ) -> list[float]:
        """Return how far each robot's trips may be filled for the longest to fit once complete."""
        out = [1.0] * len(self.base.work.robots)
        for robot, before, after in zip(part.work.robots, planned, measured, strict=True):
            row = self.base.row[robot]
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
        if self._planner is None or self.base.endless:  # cut, where no battery binds
            return self.base.plan_of(self.base.cut_tours(allowed))
        found = TripSearch(self.base, self._planner).search(allowed)
        planned = self.base.planned(found)
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
        out: list[list[CoveragePath]] = [[] for _ in self.base.work.robots]
        planned = self.base.planned(part)
        rows = zip(part.work.robots, part.tours.paths, planned, measured, strict=True)
        for robot, path, before, after in rows:
            row = self.base.row[robot]
            if max(before, after) <= 1.0:
                out[row].append(path)
                continue
            try:
                allowed = MARGIN * min(1.0, before / after)
                out[row] += self.base.cutter(row, path, allowed).trips(2)
            except TooFarError as error:
                # even a piece of it, turned as it is sailed
                if self.base.used_as_sailed(row, error.trip) > 1.0:
                    raise
                # so short they cannot be; in two will do for now
                out[row] += self.base.cutter(row, path, 1.0).trips(2)
        return self.base.plan_of(out)

    def complete(self, part: PartPlan, routes: Sequence[Route]) -> PartPlan:
        """Return the part with its paths as they are once all is covered.

        Where runs or turns of a radius have been added to the routes, these would be added twice:
        the paths then stay as planned.
        """
        if max(self.base.work.options.runs_m) > 0 or self.base.work.options.turn_radius_m > 0:
            return part
        paths = tuple(
            replace(route.path, robot=path.robot)
            for route, path in zip(routes, part.tours.paths, strict=True)
        )
        return replace(part, tours=replace(part.tours, paths=paths))
