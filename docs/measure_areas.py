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


def table(rows: list[dict[str, Any]]) -> str:
    """Return the worst figures of each area as Markdown."""
    lines = [
        "| area | plans | least coverage | largest missed, % of swath² | outside, m | closed, m "
        "| longest / area bound, best method at k = " + str(max(r["k"] for r in rows)) + " |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    top = max(r["k"] for r in rows)
    for name in sorted({r["name"] for r in rows}):
        mine = [r for r in rows if r["name"] == name and "score" in r]
        if not mine:
            lines.append(f"| {name} | 0 | | | | | |")
            continue
        best = min(r["makespan_s"] / r["bound_s"] for r in mine if r["k"] == top)
        lines.append(
            f"| {name} | {len(mine)} | {min(r['score']['coverage'] for r in mine):.6f} "
            f"| {max(100 * r['score']['missed_m2'] / r['swath_m'] ** 2 for r in mine):.3f} "
            f"| {max(r['score']['outside_m'] for r in mine):.2f} "
            f"| {max(r['score']['closed_m'] for r in mine):.2f} | {best:.2f} |"
        )
    failed = [r for r in rows if r.get("fails") or "error" in r]
    lines.append("")
    lines.append(f"{len(rows)} plans, {len(rows) - len(failed)} of them within every limit.")
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
