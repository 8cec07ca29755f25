"""Sail whole plans with ArduRover in SITL and make the table of docs/rehearse.md.

    python docs/measure_driven.py OUT                      everything, one fleet after the other
    python docs/measure_driven.py OUT --area demo --model motorboat --current 0.3
    python docs/measure_driven.py OUT --table              the table of what OUT holds

Needs an `ardurover` on PATH or named by ARDUROVER. One voyage of the demo lake is two hours and a
quarter on the water. OUT keeps `rehearse.json`, tracks and a figure for each voyage;
`figures/driven.png` is the figure of `demo-motorboat-0.3`, in 64 colours.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.geojson import read_survey_area
from mrmission.model import SurveyArea
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.rehearse.figure import save_tracks
from mrmission.rehearse.files import write_rehearsal
from mrmission.rehearse.judge import Limits, judge
from mrmission.rehearse.pilot import SailOrders
from mrmission.rehearse.run import Waters, sail_missions, sailing_missions

GEOFENCES = Path(__file__).resolve().parents[1] / "geofences"
SWATH_M = 20.0
ROBOTS = 4
WATCH_S = 600.0
CASES = (("motorboat", 0.0), ("motorboat", 0.3), ("motorboat", 0.6), ("pivoting", 0.0))
"""Model and current: SITL's `pivoting` is a land vehicle, which no current moves."""
AREAS: dict[str, tuple[str, tuple[int, ...], float, float | None]] = {
    "demo": ("demo_lake", (), 0.0, None),
    "klawock": ("klawock_lake", (0, 2), 220.0, 90.0),
    "chiemsee": ("chiemsee", (0,), 70.0, 30.0),
}
"""File, islands (by number) about which a strip is cut, its width (m), bearing of the lanes.

The smaller sample areas have no 160 lanes of 20 m, and the whole Klawock Lake takes four boats a
working day and a half: of the large lakes, the water about islands is taken.
"""


def area_of(name: str) -> SurveyArea:
    """Return a survey area: a whole file, or the strip of water about some of its islands."""
    file, islands, width_m, _ = AREAS[name]
    area = read_survey_area(GEOFENCES / f"{file}.geojson", part=None, islands=False)
    if not islands:
        return area
    frame = LocalFrame.of(area)
    water = project_polygons(area.water_lonlat, frame)
    shapes = [shapely.Polygon(part.interiors[i]) for part in water.geoms for i in islands]
    about = shapely.simplify(shapely.union_all(shapes).buffer(width_m), 2.0)
    strip = max(shapely.get_parts(about.intersection(water)), key=lambda part: part.area)
    lonlat = shapely.transform(strip, lambda points: np.round(frame.to_lonlat(points), 7))
    return replace(
        area,
        name=f"{area.name}, {width_m:g} m about {len(islands)} of its islands",
        water_lonlat=shapely.MultiPolygon([lonlat]),
        notes=(),
    )


def voyage(name: str, model: str, current_m_s: float, speedup: float, out: Path) -> None:
    """Plan, sail, measure, and keep the results."""
    options = PlanOptions(
        robots=ROBOTS,
        swath_m=SWATH_M,
        overlap=0.1,
        method="minmax",
        angle_deg=AREAS[name][3],
        steering="steered" if model == "motorboat" else "pivoting",
    )
    result = plan(area_of(name), options)
    waters = Waters(
        engine="ardupilot", model=model, speedup=speedup, current_m_s=current_m_s, waves=True
    ).across(result.report.angle_deg)
    tracks = asyncio.run(
        sail_missions(
            sailing_missions(result.missions),
            waters,
            SailOrders(watch_end_s=WATCH_S),
            stage=lambda text: _say(f"{name} {model} {current_m_s:g}: {text}"),
        )
    )
    driven = judge(
        result,
        tracks,
        limits=Limits(cross_track_m=SWATH_M / 10),
        delays_s={row.robot: row.start_delay_s for row in result.report.robots},
        waters=waters.as_dict(),
    )
    folder = out / f"{name}-{model}-{current_m_s:g}"
    write_rehearsal(driven, tracks, folder, overwrite=True)
    save_tracks(result, tracks, driven, folder / "tracks.png", dpi=140, end=False, overwrite=True)


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")


def cells(found: dict[str, Any]) -> list[str]:
    """Return one row of the table."""
    robots, cross, met = found["robots"], found["cross_track"], found["nearest"]
    lanes = [row["lanes"] for row in robots]
    home = [row for row in robots if row["home"]]
    off = [row["driven_s"] / row["planned_s"] - 1 for row in home]
    watched = [row["watched_m"] for row in home if row["watched_s"] >= WATCH_S - 1]
    holding = sum(w <= found["limits"]["home_m"] for w in watched)
    whole = len(home) == len(robots)
    return [
        found["area"],
        str(found["waters"]["model"]),
        f"{found['waters']['current_m_s']:g}",
        f"{min(lanes)}–{max(lanes)}",
        f"{len(home)} of {len(robots)}",
        f"{min(off):+.1%} … {max(off):+.1%}" if off else "–",
        f"{100 * found['coverage']['share']:.3f}",
        (
            f"{100 * found['coverage_survey_legs']['share']:.2f} "
            f"({100 * found['planned_coverage_survey_legs']:.2f})"
        ),
        f"{cross['mean_m']:.2f} / {cross['p95_m']:.2f} / {cross['max_m']:.1f}" if whole else "–",
        str(found["fence_events"]),
        f"{met['distance_m']:.1f}" if met and whole else "–",
        f"{holding} of {len(watched)}, {max(watched):.0f} m" if watched else "–",
    ]


def table(out: Path) -> str:
    """Return the Markdown table of the rehearsals in a folder."""
    head = [
        "area", "vehicle", "current m/s", "lanes per boat", "home", "driven / predicted time",
        "swept %", "by survey legs (planned) %", "from lanes: mean / p95 / largest m",
        "fence events", "nearest two m", "hold their end for 10 min, farthest",
    ]  # fmt: skip
    rows = [head, ["---"] * len(head)]
    rows += [
        cells(json.loads(path.read_text("utf-8"))) for path in sorted(out.glob("*/rehearse.json"))
    ]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def main() -> None:
    """Sail what is asked for, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--area", choices=AREAS, action="append")
    parser.add_argument("--model", action="append")
    parser.add_argument("--current", type=float, action="append")
    parser.add_argument("--speedup", type=float, default=20.0)
    parser.add_argument("--table", action="store_true")
    given = parser.parse_args()
    if not given.table:
        for name in given.area or AREAS:
            for model, current_m_s in CASES:
                if model in (given.model or [model]) and current_m_s in (
                    given.current or [current_m_s]
                ):
                    voyage(name, model, current_m_s, given.speedup, given.out)
    sys.stdout.write(table(given.out) + "\n")


if __name__ == "__main__":
    main()
