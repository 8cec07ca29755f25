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
from mrmission.tour.turnaround import with_turnarounds
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
        options = work.options
        self._radius_m = options.turn_radius_m
        boat = options.vehicle != "copter"
        self._gentle = boat and self._radius_m == 0 and options.steering == "steered"
        # where lanes alone cover, runs come after covering, and gentle corners after the runs
        self._runs = max(options.runs_m) > 0
        self._limits = work.region_m if boat else None
        self._sharp_m = np.zeros((0, 2))
        self._keep_m: list[FloatArray] = [np.zeros((0, 2)) for _ in work.homes_m]
        robots = range(len(work.homes_m)) if self._radius_m > 0 or self._gentle else range(0)
        self._waters: list[BerthWater] = [
            Waters(work.harbour, i, self._radius_m, options.wp_radius_m)
            if self._radius_m > 0
            else BerthWater(work.harbour, i)
            for i in robots
        ]

    def before_covering(self, paths: Sequence[CoveragePath]) -> tuple[CoveragePath, ...]:
        """Return paths as the planner joins them, turned."""
        if self._radius_m > 0:
            return self._rounded([self._with_runs(p) for p in paths], None)
        return tuple(paths)

    def after_covering(
        self, paths: Sequence[CoveragePath], before: Sequence[CoveragePath]
    ) -> tuple[CoveragePath, ...]:
        """Return paths turned again: `before` they were made to cover the rest they were turned."""
        if self._radius_m > 0:
            return self._rounded(paths, before)
        return self._gently(paths) if self._gentle and not self._runs else tuple(paths)

    def for_export(self, paths: Sequence[CoveragePath]) -> list[CoveragePath]:
        """Return paths that cover everything, with the runs before and after their lanes."""
        if self._radius_m > 0:
            return list(paths)
        turned = [self._with_runs(p) for p in paths]
        return list(self._gently(turned)) if self._gentle and self._runs else turned

    def notes(self, frame: LocalFrame) -> tuple[str, ...]:
        """Return what to say about corners that no turn of the radius fits into."""
        if not len(self._sharp_m):
            return ()
        lon, lat = frame.to_lonlat(self._sharp_m[:1])[0]
        count = len(self._sharp_m)
        corners = "1 corner is" if count == 1 else f"{count} corners are"
        where = "" if count == 1 else "the first "
        return (
            (
                f"{corners} tighter than --turn-radius {self._radius_m:g} m, no turn fits the "
                f"water: {where}near {lon:.5f},{lat:.5f}; choose another --angle or look there"
            ),
        )

    def _with_runs(self, path: CoveragePath) -> CoveragePath:
        run_in_m, run_out_m = self._work.options.runs_m
        return with_turnarounds(path, run_in_m, self._limits, run_out_m)

    def _rounded(
        self, paths: Sequence[CoveragePath], before: Sequence[CoveragePath] | None
    ) -> tuple[CoveragePath, ...]:
        options, out, sharp = self._work.options, [], [self._sharp_m[:0]]
        for i, (path, waters) in enumerate(zip(paths, self._waters, strict=True)):
            assert isinstance(waters, Waters)  # as made above
            if before is not None:  # what covering the rest goes by must be passed from now on
                new = _new_points(path, before[i])
                self._keep_m[i] = np.concatenate([self._keep_m[i], new])
            turned, left = round_transits(
                path,
                waters,
                options.swath_m,
                keep_m=self._keep_m[i],
                lanes_alone=options.lanes_alone_count,
            )
            out.append(turned)
            sharp.append(left)
        self._sharp_m = np.concatenate(sharp)
        return tuple(out)

    def _gently(self, paths: Sequence[CoveragePath]) -> tuple[CoveragePath, ...]:
        work = self._work
        return tuple(
            avoid_reversals(path, water, time, work.options.clearance_m)
            for path, water, time in zip(paths, self._waters, work.times, strict=True)
        )


def _new_points(path: CoveragePath, before: CoveragePath) -> FloatArray:
    """Return the points of a path that the path before it did not have."""
    old = {(x, y) for x, y in before.points_m.tolist()}
    rows = [(x, y) for x, y in path.points_m.tolist() if (x, y) not in old]
    return np.array(rows, dtype=np.float64).reshape(-1, 2)
