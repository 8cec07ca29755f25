"""Measure how near to best fleet plans are: makespans and gaps by number of robots and method.

    python docs/measure_gaps.py AREAS... --random-maps 40 --out gaps.jsonl --judge score_missions.py
    python docs/measure_gaps.py --out gaps.jsonl --table [AREAS...] [--random-maps 40] [--seed 0]
    python docs/measure_gaps.py --out gaps.jsonl --figure docs/figures/methods.svg

Areas are planned at a swath of the longest side of their bounding box over 150, overlap 0,
clearance 0, from the middle of the largest part; random maps are those of
`mrmission experiments paper`, at 10 m per pixel. CPU time is that of reading, planning and
exporting one area in a process that has planned before; without fences. Boats are not kept apart
(`--separation 0`) and hold any number of items, so that the makespan is that of the tours. One JSON
line per plan; resumable: what is in the file already is not planned again. Tables and figures are
of the areas and seeds that are named; of all where none is.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.region import navigable_region, parts_by_size
from mrmission.cli.areas import read_area
from mrmission.errors import MrMissionError
from mrmission.model import SurveyArea
from mrmission.options import METHODS, PlanOptions, VehicleLimits
from mrmission.pipeline import plan
from mrmission.results import write_results

COLUMNS = 150
METRES_PER_PX = 10.0
MAP_COLUMNS = 60
KEYS = ("area", "k", "method", "seed", "budget")


def read_case(name: str, folder: Path) -> tuple[SurveyArea, Path]:
    """Return an area and the file that the judge is to read; ``map:7`` is random map 7."""
    if not name.startswith("map:"):
        return read_area(Path(name), None, None, None), Path(name)
    from mrmission.experiments.driven import save_map
    from mrmission.experiments.random_maps import random_map

    image = folder / "map.png"
    save_map(random_map(0, int(name[4:])), image)
    return read_area(image, METRES_PER_PX, (-80.0, 34.0), None), folder / "area.geojson"


def options_of(area: SurveyArea, columns: int, **more: Any) -> PlanOptions:
    """Return the options of a case: a swath of the longest side over `columns`, see the module."""
    frame = LocalFrame.of(area)
    water = project_polygons(area.water_lonlat, frame)
    x_min, y_min, x_max, y_max = water.bounds
    point = parts_by_size(navigable_region(water, 0.0))[0].representative_point()
    start = tuple(np.round(frame.to_lonlat(np.array([[point.x, point.y]]))[0], 7).tolist())
    return PlanOptions(
        swath_m=max(x_max - x_min, y_max - y_min) / columns, overlap=0.0, clearance_m=0.0,
        starts_lonlat=(start,), fence=False, separation_m=0.0,
        limits=VehicleLimits(mission_items=20_000), **more,
    )  # fmt: skip


def run(case: dict[str, Any], judge: str | None) -> dict[str, Any]:
    """Plan one case, return its figures."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        began = time.process_time()
        area, scored = read_case(case["area"], folder)
        options = options_of(
            area, MAP_COLUMNS if case["area"].startswith("map:") else COLUMNS,
            robots=case["k"], method=case["method"], seed=case["seed"],
            time_budget_s=case["budget"],
        )  # fmt: skip
        try:
            fleet = plan(area, options)
        except MrMissionError as error:
            return {**case, "error": f"{type(error).__name__}: {error}"}
        report = fleet.report
        row = {
            **case,
            "cpu_s": time.process_time() - began,
            "makespan_s": report.makespan_s,
            "any_gap": report.gap,
            "lanes_gap": report.lanes_gap,
            "any_bound": report.lower_bound_name,
            "lanes_bound": report.lanes_bound_name,
            "utilization": report.utilization,
            "lanes": sum(r.lanes for r in report.robots),
            "mean_s": float(np.mean([r.duration_s for r in report.robots])),
            "longest_m": max(r.length_m for r in report.robots),
        }
        if judge:
            write_results(fleet, folder / "out", overwrite=True)
            if case["area"].startswith("map:"):
                scored = folder / "out" / "area.geojson"
            command = [
                sys.executable, judge, str(scored),
                *map(str, sorted((folder / "out").glob("*.plan"))),
                "--swath", repr(options.swath_m), "--clearance", "0.0",
                "--start={},{}".format(*options.starts_lonlat[0]), "--json",
            ]  # fmt: skip
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            row["score"] = json.loads(done.stdout) if done.returncode == 0 else done.stderr[-300:]
        return row


def _warm() -> None:
    """Load what is compiled before anything is timed."""
    run({"area": "map:0", "k": 8, "method": "minmax", "seed": 0, "budget": 0.1}, None)


def _by_area(rows: list[dict[str, Any]], key: str) -> dict[str, list[float]]:
    """Return a figure of all seeds, by area."""
    out: dict[str, list[float]] = {}
    for row in rows:
        if row.get(key) is not None:
            out.setdefault(row["area"], []).append(row[key])
    return out


def _median_of_seeds(rows: list[dict[str, Any]], key: str) -> dict[str, float]:
    """Return the median over seeds of a figure, by area."""
    return {area: float(np.median(values)) for area, values in _by_area(rows, key).items()}


def _ratios(rows: list[dict[str, Any]], method: str, k: int) -> list[float]:
    """Return another method's makespans over the lane planner's, by area."""
    of_k = [r for r in rows if r["k"] == k and "error" not in r]
    ours = _median_of_seeds([r for r in of_k if r["method"] == "minmax"], "makespan_s")
    theirs = _median_of_seeds([r for r in of_k if r["method"] == method], "makespan_s")
    return [theirs[a] / ours[a] for a in sorted(theirs) if a in ours]


def figure(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw the ratios of makespans by k."""
    import matplotlib as mpl

    mpl.use("Agg")
    mpl.rcParams["svg.hashsalt"] = "gaps"
    import matplotlib.pyplot as plt

    kinds = {
        "areas": [r for r in rows if not r["area"].startswith("map:")],
        "random maps": [r for r in rows if r["area"].startswith("map:")],
    }
    kinds = {name: mine for name, mine in kinds.items() if len({r["method"] for r in mine}) > 1}
    fig, axes = plt.subplots(1, len(kinds), figsize=(5 * len(kinds), 4), squeeze=False)
    for ax, (name, mine) in zip(axes[0], kinds.items(), strict=True):
        count = len({r["area"] for r in mine if r["method"] != "minmax"})
        for marker, method in zip("osd^", [m for m in METHODS if m != "minmax"], strict=True):
            robots = [k for k in sorted({r["k"] for r in mine}) if _ratios(mine, method, k)]
            mean = [float(np.exp(np.mean(np.log(_ratios(mine, method, k))))) for k in robots]
            ax.plot(robots, mean, marker=marker, label=method.upper())
        ax.axhline(1.0, color="black", linewidth=0.8)
        ax.set_xscale("log", base=2)
        ax.set_yscale("log")
        ticks = sorted({r["k"] for r in mine})
        ax.set_xticks(ticks, [str(k) for k in ticks])
        ax.set_yticks([1, 2, 3, 5, 10], ["1", "2", "3", "5", "10"])
        ax.minorticks_off()
        ax.set_xlabel("robots k")
        ax.set_ylabel("makespan / makespan of minmax")
        ax.set_title(f"{count} {name}, geometric mean")
        ax.legend()
    fig.tight_layout()
    fig.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def _apart(rows: list[dict[str, Any]]) -> list[float]:
    """Return by how much the worst seed's makespan is longer than the best one's, by area."""
    seeds = _by_area(rows, "makespan_s").values()
    return [max(values) / min(values) - 1 for values in seeds if len(values) > 1]


def table(rows: list[dict[str, Any]]) -> str:
    """Return gaps of the lane planner by k, and ratios of makespans by method, as Markdown."""
    rows = [r for r in rows if "error" not in r]
    robots = sorted({r["k"] for r in rows})
    lines = []
    for title, maps in (("Areas", False), ("Random maps", True)):
        mine = [r for r in rows if r["area"].startswith("map:") == maps]
        ours = [r for r in mine if r["method"] == "minmax"]
        if not ours:
            continue
        areas, seeds = len({r["area"] for r in ours}), len({r["seed"] for r in ours})
        lines += [
            f"{title}: {areas}, seeds: {seeds}, plans: {len(ours)}",
            "",
            (
                "| k | gap to these lanes' bound, mean % | median | worst | gap to any plan's "
                "bound, mean % | best to worst seed, mean % (largest) | least utilization "
                "| CPU, mean s | CPU, worst s |"
            ),
            "| ---: |" + " ---: |" * 8,
        ]
        for k in robots:
            of_k = [r for r in ours if r["k"] == k]
            if not of_k:
                continue
            gaps = 100 * np.array(list(_median_of_seeds(of_k, "lanes_gap").values()))
            free = 100 * np.array(list(_median_of_seeds(of_k, "any_gap").values()))
            cpu = np.array([r["cpu_s"] for r in of_k])
            apart = 100 * np.array(_apart(of_k))
            seeds_apart = f"{apart.mean():.1f} ({apart.max():.1f})" if len(apart) else ""
            lines.append(
                f"| {k} | {gaps.mean():.1f} | {np.median(gaps):.1f} | {gaps.max():.1f} "
                f"| {free.mean():.1f} | {seeds_apart} | {min(r['utilization'] for r in of_k):.0%} "
                f"| {cpu.mean():.1f} | {cpu.max():.1f} |"
            )
        others = [m for m in METHODS if m != "minmax" and any(r["method"] == m for r in mine)]
        if others:
            lines += [
                "",
                "Makespan over that of minmax, geometric mean (worst for us, best for us):",
                "",
                "| k | " + " | ".join(others) + " |",
                "| ---: |" + " ---: |" * len(others),
            ]
        for k in robots if others else ():
            cells = []
            for method in others:
                ratio = _ratios(mine, method, k)
                mean = float(np.exp(np.mean(np.log(ratio)))) if ratio else float("nan")
                cells.append(f"{mean:.2f} ({min(ratio):.2f}-{max(ratio):.2f})" if ratio else "")
            if any(cells):
                lines.append(f"| {k} | " + " | ".join(cells) + " |")
        lines.append("")
    scored = [r for r in rows if isinstance(r.get("score"), dict)]
    if scored:
        wrong = max(abs(r["score"]["longest_m"] / r["longest_m"] - 1) for r in scored)
        lines += [
            (
                f"{len(scored)} plans scored: least coverage "
                f"{min(r['score']['coverage'] for r in scored):.6f}, most outside "
                f"{max(r['score']['outside_m'] for r in scored):.2f} m, longest tour against the "
                f"report's within {100 * wrong:.4f} %."
            ),
        ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run the cases that are not in the file yet, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("areas", nargs="*")
    parser.add_argument("--random-maps", type=int, default=0)
    parser.add_argument("--judge")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--k", type=int, action="append")
    parser.add_argument("--method", action="append")
    parser.add_argument("--seed", type=int, action="append")
    parser.add_argument("--budget", type=float, default=3.0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--figure", type=Path)
    args = parser.parse_args()
    done = []
    if args.out.exists():
        done = [json.loads(line) for line in args.out.read_text().splitlines()]
    areas = args.areas + [f"map:{i}" for i in range(args.random_maps)]
    shown = [
        row
        for row in done
        if row["area"] in (areas or [row["area"]]) and row["seed"] in (args.seed or [row["seed"]])
    ]
    if args.table:
        sys.stdout.write(table(shown))
    if args.figure:
        figure(shown, args.figure)
    if args.table or args.figure:
        return
    seen = {tuple(row[key] for key in KEYS) for row in done}
    todo = [
        {"area": area, "k": k, "method": method, "seed": seed, "budget": args.budget}
        for seed in args.seed or [0]
        for method in args.method or ["minmax"]
        for area in areas
        for k in args.k or [2, 4, 8, 16, 32]
    ]
    todo = [case for case in todo if tuple(case[key] for key in KEYS) not in seen]
    with ProcessPoolExecutor(args.workers, initializer=_warm) as pool, args.out.open("a") as stream:
        futures = [pool.submit(run, case, args.judge) for case in todo]
        for case, future in zip(todo, futures, strict=True):
            try:
                row = future.result()
            except Exception as error:  # a bug in one case must not end the study
                row = {**case, "error": f"BUG {error!r}"}
            stream.write(json.dumps(row) + "\n")
            stream.flush()


if __name__ == "__main__":
    main()
