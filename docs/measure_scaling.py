"""Plan one lake with more and more lanes and write down time and memory of the whole plan.

    python docs/measure_scaling.py --lanes 100 1000 10000 50000 --out scaling.jsonl
    python docs/measure_scaling.py --out scaling.jsonl --table
    python docs/measure_scaling.py --out scaling.jsonl --figure docs/figures/scaling.svg

The lake is drawn: 4 km across, a rough shore, 100 islands unless told otherwise. The swath is
chosen so that about as many lanes lie in it as are asked for. With `--alone` boats are not kept
apart and hold any number of items, so that the makespan is that of the tours. Every plan runs in a
process of its own, kernels warm, with one line of JSON for it; what is in the file already is not
planned again.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import shapely

from mrmission.area.region import navigable_region
from mrmission.model import SurveyArea
from mrmission.options import PlanOptions, VehicleLimits
from mrmission.pipeline import plan
from mrmission.results import write_results
from mrmission.tour.sweep import sweep_region

LON_DEG, LAT_DEG = 8.4, 53.1
RADIUS_M = 2000.0
CORNERS_PER_ISLAND = 25
BEARING_DEG = 30.0
CLEARANCE_M = 2.0
ANY_ITEMS = 20_000


def lake(islands: int) -> shapely.Polygon:
    """Return the lake in metres about its middle; half of its corners are those of islands."""
    rng = np.random.default_rng(0)

    def blob(x: float, y: float, radius: float, count: int, rough: float) -> shapely.Polygon:
        turn = 2 * np.pi * np.arange(count) / count
        shape = np.ones(count)
        for k in range(2, 12):
            shape += rough / k * rng.normal() * np.cos(k * turn + rng.uniform(0, 2 * np.pi))
        shape = np.maximum(shape + 0.1 * rough * rng.uniform(-1, 1, count), 0.2)
        ring = np.column_stack([np.cos(turn), np.sin(turn)]) * (radius * shape)[:, None]
        return shapely.Polygon(ring + np.array([x, y]))

    shell = blob(0, 0, RADIUS_M, islands * CORNERS_PER_ISLAND, 0.3)
    holes: list[shapely.Polygon] = []
    while len(holes) < islands:
        x, y = rng.uniform(-RADIUS_M, RADIUS_M, 2)
        island = blob(x, y, rng.uniform(40, 120), CORNERS_PER_ISLAND, 0.5)
        if (
            island.is_valid
            and shell.contains(island.buffer(10))
            and all(island.distance(other) > 10 for other in holes)
        ):
            holes.append(island)
    return shapely.Polygon(shell.exterior, [hole.exterior for hole in holes])


def swath_for(water: shapely.Polygon, lanes: int) -> float:
    """Return the swath at which about so many lanes lie in the water."""
    region = shapely.get_parts(navigable_region(shapely.MultiPolygon([water]), CLEARANCE_M))[0]
    low, high = 0.5, 500.0
    for _ in range(16):
        middle = float(np.sqrt(low * high))
        found = len(sweep_region(region, BEARING_DEG, middle).lane_x_m)
        if abs(found - lanes) < 0.01 * lanes:
            return middle
        low, high = (middle, high) if found > lanes else (low, middle)
    return middle


def measure(case: dict[str, Any], folder: str, results: Any) -> None:
    """Plan one case and put its figures into a queue."""
    water = lake(case["islands"])
    swath_m = swath_for(water, case["lanes"])
    plane = pyproj.Proj(f"+proj=aeqd +lat_0={LAT_DEG} +lon_0={LON_DEG} +datum=WGS84")
    lonlat = shapely.transform(
        water, lambda xy: np.column_stack(plane(xy[:, 0], xy[:, 1], inverse=True))
    )
    area = SurveyArea(
        name="drawn", source="drawn.geojson", water_lonlat=shapely.MultiPolygon([lonlat])
    )
    alone: dict[str, Any] = {}
    if case["alone"]:
        alone = {"separation_m": 0.0, "limits": VehicleLimits(mission_items=ANY_ITEMS)}
    options = PlanOptions(
        robots=case["k"], swath_m=max(0.5, swath_m), overlap=0.0, clearance_m=CLEARANCE_M,
        method="minmax", angle_deg=BEARING_DEG, time_budget_s=case["budget_s"], fence=case["fence"],
        **alone,
    )  # fmt: skip
    stages: list[tuple[str, float]] = []
    began, wall = time.process_time(), time.perf_counter()
    fleet = plan(area, options, on_stage=lambda name: stages.append((name, time.process_time())))
    planned = time.process_time()
    write_results(fleet, Path(folder) / f"lanes-{case['lanes']}", overwrite=True)
    done = time.process_time()
    stages.append(("files", planned))
    stages.append(("end", done))
    report = fleet.report
    results.put(
        {
            **case,
            "swath_m": round(options.swath_m, 3),
            "lanes_planned": sum(r.lanes for r in report.robots),
            "cpu_s": round(done - began, 2),
            "wall_s": round(time.perf_counter() - wall, 2),
            "stages_s": {name: round(after - at, 2) for (name, at), (_, after) in pairwise(stages)},
            "peak_mib": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024),
            "makespan_s": round(report.makespan_s, 1),
            "lanes_bound_s": round(report.lanes_bound_s or 0.0, 1),
            "any_plan_bound_s": round(report.lower_bound_s, 1),
            "coverage": round(report.coverage, 6),
        }
    )


def table(rows: list[dict[str, Any]]) -> str:
    """Return the figures as Markdown."""
    titles = "lanes", "k", "search", "CPU", "planning", "fences, checks", "files", "peak memory"
    out = [
        f"| {' | '.join(titles)} | over these lanes' bound | over any plan's | coverage |",
        "| ---: " * 11 + "|",
    ]
    for row in sorted(rows, key=lambda r: (r["lanes"], r["k"])):
        stages = row["stages_s"]
        out.append(
            f"| {row['lanes_planned']:,} | {row['k']} | {row['budget_s']:g} s "
            f"| {row['cpu_s']:.1f} s | {stages['planning']:.1f} s "
            f"| {stages['fencing and checking']:.1f} s | {stages['files']:.1f} s "
            f"| {row['peak_mib']:,} MiB "
            f"| +{100 * (row['makespan_s'] / row['lanes_bound_s'] - 1):.1f} % "
            f"| +{100 * (row['makespan_s'] / row['any_plan_bound_s'] - 1):.1f} % "
            f"| {100 * row['coverage']:.3f} % |"
        )
    return "\n".join(out)


def figure(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw time and memory over lanes."""
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = sorted(rows, key=lambda r: r["lanes_planned"])
    lanes = [r["lanes_planned"] for r in rows]
    with mpl.rc_context({"font.size": 8, "svg.hashsalt": "mrmission"}):
        drawing = Figure(figsize=(6.4, 2.6), layout="constrained")
        FigureCanvasAgg(drawing)
        left, right = drawing.subplots(1, 2)
        left.plot(lanes, [r["cpu_s"] for r in rows], "o-", color="#1f5f8b", label="whole plan")
        for name, colour in (("planning", "#c2571a"), ("fencing and checking", "#4d8b31")):
            values = [r["stages_s"][name] for r in rows]
            left.plot(lanes, values, ".--", color=colour, label=name)
        left.set_ylabel("CPU, s")
        left.legend(frameon=False)
        right.plot(lanes, [r["peak_mib"] for r in rows], "o-", color="#1f5f8b")
        right.set_ylabel("peak memory, MiB")
        for axis in (left, right):
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.set_xlabel("lanes")
            axis.grid(alpha=0.3)
        drawing.savefig(path, metadata={"Date": None})


def main() -> int:
    """Run what is missing, then print or draw what is there."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--lanes", type=int, nargs="*", default=[])
    parser.add_argument("--k", type=int, default=16)
    parser.add_argument("--islands", type=int, default=100)
    parser.add_argument("--alone", action="store_true")
    parser.add_argument("--time-budget", type=float, default=5.0)
    parser.add_argument("--no-fence", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("scaling.jsonl"))
    parser.add_argument("--files", default="build/scaling", help="where the plans go")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--figure", type=Path)
    given = parser.parse_args()
    text = given.out.read_text(encoding="utf-8") if given.out.exists() else ""
    rows = [json.loads(line) for line in text.splitlines()]
    wanted = ("lanes", "k", "budget_s", "fence", "islands", "alone")
    context = multiprocessing.get_context("spawn")
    for lanes in given.lanes:
        fence = not given.no_fence
        case = {
            "lanes": lanes, "k": given.k, "budget_s": given.time_budget, "fence": fence,
            "islands": given.islands, "alone": given.alone,
        }  # fmt: skip
        if any(all(row[key] == case[key] for key in wanted) for row in rows):
            continue
        results = context.Queue()
        worker = context.Process(target=measure, args=(case, given.files, results))
        worker.start()
        while worker.is_alive() and results.empty():
            worker.join(0.5)
        if results.empty():
            sys.stderr.write(f"{lanes} lanes: ended with {worker.exitcode}\n")
            continue
        row = results.get()
        worker.join()
        rows.append(row)
        with given.out.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")
    if given.table:
        sys.stdout.write(table(rows) + "\n")
    if given.figure:
        figure(rows, given.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
