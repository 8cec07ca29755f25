"""What is said of a place that no trip reaches and returns from: where, for whom, what would do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mrmission.area.frame import LocalFrame
from mrmission.minmax.trips import Allowance, TooFarError, cut_line
from mrmission.mission.items import count_items
from mrmission.model import CoveragePath, FloatArray, LegKind
from mrmission.stages.trip_work import TripWork
from mrmission.tour.path import join_pieces

ROOM = 1.03
"""What is said to be enough has so much room for what covers the rest."""
WHOLE = 0.995
"""A trip that fills its battery less than this is not kept from its place by it."""


def explain_too_far(base: TripWork, error: TooFarError, frame: LocalFrame) -> str:
    """Return one line on a place that is too far: where, for whom, and what would do."""
    row = error.trip.robot - 1
    gauge, own = base.gauges[row], base.own[row]
    battery = replace(gauge, allowance=replace(gauge.allowance, items=math.inf))
    by_items = battery.used(error.trip) < WHOLE
    place, path = (error.place_m, error.trip) if by_items else _farthest(base, row)
    lon, lat = frame.to_lonlat(place[None])[0]
    where = f"robot {base.work.robots[row]}: the water at {lon:.6f},{lat:.6f}"
    if by_items:
        need = count_items(base.as_sailed(row, path).kind, own)
        turns = " with turns of --turn-radius" if base.work.times[row].turn_radius_m > 0 else ""
        more = ", others to cover what that leaves" if need <= gauge.allowance.items else ""
        return (
            f"{where} takes {need} mission items there and back{turns}{more}, and all must fit "
            f"into {gauge.allowance.items:.0f}; give a larger --max-items or a nearer --start"
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


def _farthest(base: TripWork, row: int) -> tuple[FloatArray, CoveragePath]:
    """Return the place on the lines that is farthest from a robot's home, and a trip to it."""
    lines = [line.points_m for line in base.work.lines]
    step_m = base.work.options.swath_m
    pieces = [p for line in lines for p in cut_line(line, max(1, math.ceil(_m(line) / step_m)))]
    ends = np.array([piece[[0, -1]] for piece in pieces]).reshape(-1, 2)
    home = base.work.homes_m[row : row + 1]
    away = base.work.harbour.distances(home, ends)[0].reshape(-1, 2).sum(axis=1)
    piece = pieces[int(np.argmax(away))]
    there, back = base.home_ways(row)(piece[[0, -1]])
    legs = [
        (there, LegKind.TRANSIT, 0),
        (piece, LegKind.SURVEY, 1),
        (back[::-1], LegKind.TRANSIT, 0),
    ]
    return piece.mean(axis=0), join_pieces(row + 1, legs)


def _m(line_m: FloatArray) -> float:
    return float(np.hypot(*np.diff(line_m, axis=0).T).sum())
