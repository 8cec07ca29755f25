"""What gentle reversals change: the tables of docs/turning.md.

    python docs/measure_turns.py                         the sample areas, clearance 0 and 10 m
    python docs/measure_turns.py --radius                --turn-radius on the same areas
    python docs/measure_turns.py AREA.geojson ...        other areas

Each area is planned twice, for four boats with rudders at 2 m/s and a swath of 20 m: with every
reversal left as it is, and as `mrmission plan` does it.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from mrmission.area.geojson import read_survey_area
from mrmission.model import CoveragePath, FleetPlan
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.stages import turns
from mrmission.tour.flight import time_model
from mrmission.tour.reversals import reversals

GEOFENCES = Path(__file__).resolve().parents[1] / "geofences"
AREAS = ("harbour", "moose_lake", "demo_lake")
CLEARANCES_M = (0.0, 10.0)
RADII_M = (0.0, 4.0, 8.0, 12.0)


def _left_alone(path: CoveragePath, *_: Any) -> CoveragePath:
    return path


def _planned(area: Path, options: PlanOptions, gentle: Callable[..., CoveragePath]) -> FleetPlan:
    """Return the plan with reversals treated by `gentle`."""
    survey = read_survey_area(area)
    usual, turns.avoid_reversals = turns.avoid_reversals, gentle
    try:
        return plan(survey, options)
    finally:
        turns.avoid_reversals = usual


def _longest_s(made: FleetPlan) -> float:
    return max(row.duration_s for row in made.report.robots)


def compare_reversals(area: Path) -> None:
    """Print the rows of one area: reversals, swing and the longest tour, before and after."""
    for clearance_m in CLEARANCES_M:
        options = PlanOptions(
            robots=4, swath_m=20.0, overlap=0.1, clearance_m=clearance_m, method="minmax"
        )
        model = time_model(options)
        cells = []
        for gentle in (_left_alone, turns.avoid_reversals):
            made = _planned(area, options, gentle)
            count = sum(len(reversals(p)) for p in made.paths)
            swing = max(model.swing_m(p.points_m, p.kind) for p in made.paths)
            cells.append((count, swing, _longest_s(made)))
        (n0, s0, t0), (n1, s1, t1) = cells
        sys.stdout.write(
            f"| {area.stem} | {clearance_m:g} | {n0} → {n1} | {s0:.1f} → {s1:.1f} | "
            f"{t0:.0f} → {t1:.0f} | {100 * (t1 / t0 - 1):+.2f} % |\n"
        )
        sys.stdout.flush()


def compare_radii(area: Path) -> None:
    """Print the rows of one area: length, items and time by turn radius."""
    for radius_m in RADII_M:
        options = PlanOptions(
            robots=4, swath_m=20.0, overlap=0.1, clearance_m=0.0, method="minmax",
            turn_radius_m=radius_m,
        )  # fmt: skip
        made = _planned(area, options, turns.avoid_reversals)
        rows = made.report.robots
        tight = next((n.split()[0] for n in made.report.notes if "tighter than" in n), "0")
        sys.stdout.write(
            f"| {area.stem} | {radius_m:g} | {max(r.length_m for r in rows):,.0f} | "
            f"{_longest_s(made):,.0f} | {int(np.max([r.items for r in rows]))} | {tight} | "
            f"{100 * made.report.coverage:.3f} |\n"
        )
        sys.stdout.flush()


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("areas", nargs="*", type=Path)
    parser.add_argument("--radius", action="store_true", help="the table of turn radii")
    flags = parser.parse_args()
    areas = flags.areas or [GEOFENCES / f"{name}.geojson" for name in AREAS]
    for area in areas:
        (compare_radii if flags.radius else compare_reversals)(area)


if __name__ == "__main__":
    main()
