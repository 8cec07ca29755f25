"""Turns of a part's paths: of a radius where one is given, without reversals for boats that swing.

Turning and covering go in turn: a turn sweeps other water than the corner that it replaces, and
what covers the rest makes corners of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrmission.area.frame import LocalFrame
from mrmission.model import CoveragePath, FloatArray
from mrmission.routing.berth_water import BerthWater
from mrmission.tour.manoeuvre import Waters
from mrmission.tour.reversals import avoid_reversals
from mrmission.tour.turnaround import whole_runs, with_turnarounds
from mrmission.tour.turning import round_transits
from mrmission.tour.work import PartWork


class Turns:
    """Turns of one part's paths; robot ``i`` of the part sails path ``i``.

    Parameters
    ----------
    work
        The part.
    """

    def __init__(self, work: PartWork) -> None:
        self._work = work
        boat = work.options.vehicle != "copter"
        # where lanes alone cover, runs come after covering, and gentle corners after the runs
        self._runs = max(work.options.runs_m) > 0
        self._limits = work.region_m if boat else None
        self._waters: list[BerthWater | None] = []
        for i, time in enumerate(work.times):
            water: BerthWater | None = None
            if time.turn_radius_m > 0:
                water = Waters(work.harbour, i, time.turn_radius_m, time.radius_m)
            elif boat and time.steering == "steered":
                water = BerthWater(work.harbour, i)
            self._waters.append(water)
        self._keep_m: list[FloatArray] = [np.zeros((0, 2)) for _ in work.times]
        self._sharp_m: list[FloatArray] = [np.zeros((0, 2)) for _ in work.times]
        self._with_runs_laid: dict[int, CoveragePath] = {}

    def before_covering(self, paths: Sequence[CoveragePath]) -> tuple[CoveragePath, ...]:
        """Return paths as the planner joins them, turned."""
        return tuple(self.turned(i, path) for i, path in enumerate(paths))

    def turned(self, robot: int, path: CoveragePath) -> CoveragePath:
        """Return the path of a robot (from 0) turned, with its runs; as it is without a radius."""
        if self._radius_m(robot) <= 0:
            return path
        return self._rounded(robot, self._with_runs(robot, path), None)

    def after_covering(
        self, paths: Sequence[CoveragePath], before: Sequence[CoveragePath]
    ) -> tuple[CoveragePath, ...]:
        """Return paths turned again: `before` they were made to cover the rest they were turned."""
        out = []
        for i, path in enumerate(paths):
            if self._radius_m(i) > 0:
                out.append(self._rounded(i, path, before[i]))
            else:
                out.append(path if self._runs else self._gently(i, path))
        return tuple(out)

    def for_export(self, paths: Sequence[CoveragePath]) -> list[CoveragePath]:
        """Return paths that cover everything, with the runs before and after their lanes."""
        return [
            path
            if self._radius_m(i) > 0 or not self._runs
            else self._gently(i, self._with_runs(i, path))
            for i, path in enumerate(paths)
        ]

    def notes(self, frame: LocalFrame) -> tuple[str, ...]:
        """Return what to say about corners that no turn fits into, and about runs left out."""
        return (*self._sharp_notes(frame), *self._run_notes())

    def _run_notes(self) -> tuple[str, ...]:
        if not self._runs:
            return ()
        run_in_m, run_out_m = self._work.options.runs_m
        counts = [whole_runs(p, run_in_m, run_out_m) for p in self._with_runs_laid.values()]
        whole_in, whole_out, lines = np.sum(counts, axis=0).tolist()
        if min(whole_in, whole_out) == lines:
            return ()
        has = " and ".join(
            f"{count} of {lines} stretches of lines have the whole {what} of {metres:g} m"
            for what, metres, count in (
                ("run-in", run_in_m, whole_in),
                ("run-out", run_out_m, whole_out),
            )
            if metres > 0
        )
        why = "there is no more water; --shore-laps makes room at the shore"
        return (f"{has}: {why}",)

    def _sharp_notes(self, frame: LocalFrame) -> tuple[str, ...]:
        sharp = np.concatenate(self._sharp_m)
        if not len(sharp):
            return ()
        lon, lat = frame.to_lonlat(sharp[:1])[0]
        corners = "1 corner is" if len(sharp) == 1 else f"{len(sharp)} corners are"
        where = "" if len(sharp) == 1 else "the first "
        radii = sorted({f"{r:g}" for r in map(self._radius_m, range(len(self._waters))) if r > 0})
        return (
            (
                f"{corners} tighter than --turn-radius {' or '.join(radii)} m, no turn fits the "
                f"water: {where}near {lon:.5f},{lat:.5f}; choose another --angle or look there"
            ),
        )

    def _radius_m(self, robot: int) -> float:
        return self._work.times[robot].turn_radius_m

    def _with_runs(self, robot: int, path: CoveragePath) -> CoveragePath:
        run_in_m, run_out_m = self._work.options.runs_m
        path = with_turnarounds(path, run_in_m, self._limits, run_out_m)
        self._with_runs_laid[robot] = path
        return path

    def _rounded(self, robot: int, path: CoveragePath, before: CoveragePath | None) -> CoveragePath:
        options, waters = self._work.options, self._waters[robot]
        assert isinstance(waters, Waters)  # as made above
        if before is not None:  # what covering the rest goes by must be passed from now on
            new = _new_points(path, before)
            self._keep_m[robot] = np.concatenate([self._keep_m[robot], new])
        turned, self._sharp_m[robot] = round_transits(
            path,
            waters,
            options.swath_m,
            keep_m=self._keep_m[robot],
            lanes_alone=options.lanes_alone_count,
            runs=self._runs,
        )
        return turned

    def _gently(self, robot: int, path: CoveragePath) -> CoveragePath:
        water, time = self._waters[robot], self._work.times[robot]
        if water is None:
            return path
        return avoid_reversals(path, water, time, self._work.options.clearance_m)


def _new_points(path: CoveragePath, before: CoveragePath) -> FloatArray:
    """Return the points of a path that the path before it did not have."""
    old = {(x, y) for x, y in before.points_m.tolist()}
    rows = [(x, y) for x, y in path.points_m.tolist() if (x, y) not in old]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)
