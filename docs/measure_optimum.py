"""Where the gap lies: plans of few lines, and the bound, against the best way to sweep those lines.

    python docs/measure_optimum.py AREAS... --random-maps 24

Areas are planned as by `measure_gaps.py`, but with so wide a swath that the plan has few lines. The
best way to share them out, found by looking at every one, is compared with the plan, at the prices
of the search, and, at the prices that no plan undercuts, with the bound as it is for many lines.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from measure_gaps import options_of, read_case

from mrmission.errors import MrMissionError
from mrmission.minmax import line_bound, planner
from mrmission.minmax.bounds import lanes
from mrmission.minmax.bounds.few_lines import few_lines_makespan
from mrmission.minmax.costs import line_costs
from mrmission.pipeline import plan

COLUMNS = (8, 10, 12, 14)
ROBOTS = (2, 3, 4)
MOST_LINES = 16


def compare(name: str, columns: int, robots: int, folder: Path) -> dict[str, float] | None:
    """Return the ratios of one case; None where it has too many lines, or too few to share out."""
    area, _ = read_case(name, folder)
    options = options_of(area, columns, robots=robots, method="minmax", time_budget_s=1.0)
    seen: dict[str, Any] = {}
    usual = planner.bound_of_lines, line_bound.lanes_bound, lanes.few_lines_makespan

    def of_lines(*given: Any) -> Any:
        seen["lines"] = given[:3]
        return usual[0](*given)

    def of_prices(**given: Any) -> Any:
        seen["prices"], seen["bound"] = given, usual[1](**given)
        return seen["bound"]

    planner.bound_of_lines, line_bound.lanes_bound = of_lines, of_prices
    lanes.few_lines_makespan = lambda *_: 0.0
    try:
        report = plan(area, options).report
    except MrMissionError:
        return None
    finally:
        planner.bound_of_lines, line_bound.lanes_bound, lanes.few_lines_makespan = usual
    if "lines" not in seen:
        return None
    lines, hooks, work = seen["lines"]
    if not robots < len(lines) <= MOST_LINES:
        return None
    searched = line_costs(
        lines, hooks, work.harbour, work.homes_m, work.times,
        lanes_alone=work.options.lanes_alone_count,
    ).problem  # fmt: skip
    least = seen["prices"]
    ones = np.ones(robots)
    best_s = few_lines_makespan(
        searched.lane_cost, searched.end_cost, searched.home_cost, (ones, ones)
    )
    least_s = few_lines_makespan(least["line_s"], least["end_s"], least["home_s"], (ones, ones))
    return {
        "lines": len(lines),
        "plan over best": report.makespan_s / best_s,
        "best over best at the bound's prices": best_s / least_s,
        "that over bound": least_s / seen["bound"].makespan_s,
    }


def main() -> None:
    """Print the cases and, by number of robots, the means."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("areas", nargs="*")
    parser.add_argument("--random-maps", type=int, default=0)
    args = parser.parse_args()
    names = args.areas + [f"map:{i}" for i in range(args.random_maps)]
    for robots in ROBOTS:
        rows = []
        for name in names:
            for columns in COLUMNS:
                with tempfile.TemporaryDirectory() as folder:
                    row = compare(name, columns, robots, Path(folder))
                if row:
                    rows.append(row)
        if not rows:
            continue
        cells = [_percent([row[key] for row in rows]) for key in list(rows[0])[1:]]
        few, many = (int(f(row["lines"] for row in rows)) for f in (min, max))
        sys.stdout.write(f"| {robots} | {len(rows)} | {few}-{many} | {' | '.join(cells)} |\n")


def _percent(ratios: list[float]) -> str:
    """Return by how much ratios are above 1: mean, least and largest."""
    above = 100 * (np.array(ratios) - 1)
    return f"{above.mean():.1f} ({above.min():.1f} to {above.max():.1f})"


if __name__ == "__main__":
    main()
