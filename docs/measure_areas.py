"""Plan many areas with every method and let an independent judge score the exported missions.

    python docs/measure_areas.py AREAS... --judge score_missions.py --out results.jsonl

Every area is planned for each k, method and clearance, overlap 0, at a swath of the longest side
of its bounding box over 150; images at 1 m per pixel and a swath of 5 m. One JSON line per plan;
resumable: what is in the file already is not planned again. `--table` makes Markdown of it.
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
from mrmission.cli.areas import IMAGE_SUFFIXES, read_area
from mrmission.errors import MrMissionError
from mrmission.options import METHODS, PlanOptions
from mrmission.pipeline import plan
from mrmission.results import write_results

LIMITS = {"coverage": 0.9995, "missed": 0.01, "outside_m": 0.0, "closed_m": 1.0, "unreached": 0.01}


def cases(areas: list[Path], robots: list[int], methods: list[str]) -> list[dict[str, Any]]:
    """Return one case per area, clearance, k and method."""
    out = []
    for path in areas:
        image = path.suffix in IMAGE_SUFFIXES
        for clearance in (0.0,) if image else (0.0, 0.25):
            for k in robots:
                out.extend(
                    {"area": str(path), "k": k, "method": method, "clearance": clearance}
                    for method in methods
                )
    return out


def run(case: dict[str, Any], judge: str, fence: bool) -> dict[str, Any]:
    """Plan one case, score its files, return the figures."""
    path = Path(case["area"])
    image = path.suffix in IMAGE_SUFFIXES
    began = time.process_time()
    area = read_area(path, 1.0 if image else None, (-80.0, 34.0) if image else None, None)
    frame = LocalFrame.of(area)
    water = project_polygons(area.water_lonlat, frame)
    x_min, y_min, x_max, y_max = water.bounds
    swath = 5.0 if image else max(x_max - x_min, y_max - y_min) / 150
    clearance = case["clearance"] * swath
    largest = parts_by_size(navigable_region(water, clearance))[0]
    point = largest.representative_point()
    start = tuple(np.round(frame.to_lonlat(np.array([[point.x, point.y]]))[0], 7).tolist())
    result = {**case, "name": path.stem, "swath_m": swath}
    try:
        fleet = plan(
            area,
            PlanOptions(
                robots=case["k"],
                swath_m=swath,
                overlap=0.0,
                clearance_m=clearance,
                method=case["method"],
                starts_lonlat=(start,),
                fence=fence,
            ),
        )
    except MrMissionError as error:
        return {**result, "error": f"{type(error).__name__}: {error}"}
    result["cpu_s"] = time.process_time() - began
    report = fleet.report
    result |= {
        "makespan_s": report.makespan_s,
        "bound_s": report.lower_bound_s,
        "items": max(r.items for r in report.robots),
        "land_m2": sum(r.fence_land_m2 for r in report.robots),
        "longest_reported_m": max(r.length_m for r in report.robots),
    }
    with tempfile.TemporaryDirectory() as folder:
        write_results(fleet, Path(folder), overwrite=True)
        scored = Path(folder) / "area.geojson" if image else path
        command = [
            sys.executable, judge, str(scored), *map(str, sorted(Path(folder).glob("*.plan"))),
            "--swath", repr(swath), "--clearance", repr(clearance),
            f"--start={start[0]},{start[1]}", "--json",
        ]  # fmt: skip
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        return {**result, "error": f"judge: {done.stderr.strip().splitlines()[-1]}"}
    result["score"] = json.loads(done.stdout)
    score = result["score"]
    unreached = abs(score["unreached_m2"] - report.unreached_m2)
    result["fails"] = [
        name
        for name, bad in (
            ("coverage", score["coverage"] < LIMITS["coverage"]),
            ("missed", score["missed_m2"] > LIMITS["missed"] * swath**2),
            ("outside_m", score["outside_m"] > LIMITS["outside_m"]),
            ("closed_m", score["closed_m"] > LIMITS["closed_m"]),
            ("unreached", unreached > LIMITS["unreached"] * max(score["unreached_m2"], 1.0)),
        )
        if bad
    ]
    return result


def label(row: dict[str, Any], rows: list[dict[str, Any]]) -> str:
    """Return the name of an area, with its folder where two share a name."""
    path = Path(row["area"])
    twins = {r["area"] for r in rows if r["name"] == row["name"]}
    return path.stem if len(twins) == 1 else f"{path.parent.name}/{path.stem}"


def table(rows: list[dict[str, Any]]) -> str:
    """Return the worst figures of each area, and the mean ratio of each method, as Markdown."""
    robots = sorted({r["k"] for r in rows})
    methods = [m for m in METHODS if any(r["method"] == m for r in rows)]
    lines = [
        "| area | plans | least coverage | largest missed, % of swath² | outside, m | home, m |",
        "| --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    groups: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(label(row, rows), []).append(row)
    for name in sorted(groups):
        mine = [r for r in groups[name] if "score" in r]
        scores = [r["score"] for r in mine]
        missed = max(100 * r["score"]["missed_m2"] / r["swath_m"] ** 2 for r in mine)
        lines.append(
            f"| {name} | {len(mine)} | {min(s['coverage'] for s in scores):.6f} | {missed:.2f} "
            f"| {max(s['outside_m'] for s in scores):.2f} "
            f"| {max(s['closed_m'] for s in scores):.2f} |"
        )
    failed = [r for r in rows if r.get("fails") or "error" in r]
    lines += ["", f"{len(rows)} plans, {len(rows) - len(failed)} of them within every limit.", ""]
    lines += [
        "Mean of makespan over area bound (and the worst):",
        "",
        "| method | " + " | ".join(f"k = {k}" for k in robots) + " |",
        "| --- |" + " ---: |" * len(robots),
    ]
    for method in methods:
        cells = []
        for k in robots:
            ratios = [
                r["makespan_s"] / r["bound_s"]
                for r in rows
                if r["method"] == method and r["k"] == k and "score" in r
            ]
            mean = f"{np.mean(ratios):.2f} ({max(ratios):.2f})" if ratios else ""
            cells.append(mean)
        lines.append(f"| {method} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run the cases that are not in the file yet, or print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("areas", nargs="*", type=Path)
    parser.add_argument("--judge", default="score_missions.py")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--k", type=int, action="append")
    parser.add_argument("--method", action="append")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--no-fence", action="store_true", help="the judge looks at paths only")
    parser.add_argument("--table", action="store_true")
    args = parser.parse_args()
    done = []
    if args.out.exists():
        done = [json.loads(line) for line in args.out.read_text().splitlines()]
    if args.table:
        sys.stdout.write(table(done))
        return
    keys = ("area", "k", "method", "clearance")
    seen = {tuple(row[key] for key in keys) for row in done}
    todo = [
        case
        for case in cases(args.areas, args.k or [1, 3, 6], args.method or list(METHODS))
        if tuple(case[key] for key in keys) not in seen
    ]
    with ProcessPoolExecutor(args.workers) as pool, args.out.open("a") as stream:
        futures = [pool.submit(run, case, args.judge, not args.no_fence) for case in todo]
        for case, future in zip(todo, futures, strict=True):
            try:
                row = future.result()
            except Exception as error:  # a bug in one case must not end the study
                row = {**case, "name": Path(case["area"]).stem, "error": f"BUG {error!r}"}
            stream.write(json.dumps(row) + "\n")
            stream.flush()


if __name__ == "__main__":
    main()
