"""Sail fleets with and without --separation and make the table of docs/separation.md.

    python docs/measure_separation.py OUT                    light boats, then ArduRover
    python docs/measure_separation.py OUT --engine light     light boats alone
    python docs/measure_separation.py OUT --case harbour-3   one fleet
    python docs/measure_separation.py OUT --random 40 --engine light    random landings instead
    python docs/measure_separation.py OUT --table            the tables of what OUT holds

Each fleet is planned twice, with `--separation 0` and with the default, and both plans are sailed.
The missions wait by themselves (`--wait-in-mission`), so the delays are sailed too. ArduRover is
taken from PATH or from ARDUROVER. OUT keeps `rehearse.json`, tracks and the predictions.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from mrmission.area.frame import LocalFrame, project_polygons
from mrmission.area.geojson import read_survey_area
from mrmission.model import FleetPlan, SurveyArea
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.rehearse.files import write_rehearsal
from mrmission.rehearse.judge import Limits, judge
from mrmission.rehearse.run import ENGINES, Waters, sail_missions, sailing_missions
from mrmission.report.metrics import plain
from mrmission.tour.flight import time_model
from mrmission.tour.separation import SeparationRules, measure, timeline

GEOFENCES = Path(__file__).resolve().parents[1] / "geofences"
BOATS_TIMES_SPEEDUP = {"light": 160.0, "ardupilot": 24.0}
"""What two cores carry."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A fleet: sample area, swath, and where each robot starts; no starts: berths side by side."""

    name: str
    title: str
    file: str
    robots: int
    swath_m: float
    starts_lonlat: tuple[tuple[float, float], ...] = ()


CASES = (
    Case(
        name="harbour-2", title="Harbour, 2 landings", file="harbour", robots=2, swath_m=60.0,
        starts_lonlat=((11.004777, 58.000615), (11.004687, 58.001238)),
    ),
    Case(
        name="harbour-3", title="Harbour, 3 landings", file="harbour", robots=3, swath_m=40.0,
        starts_lonlat=((11.004099, 58.000542), (11.004887, 58.000713), (11.003123, 58.000437)),
    ),
    Case(
        name="harbour-4", title="Harbour, 4 landings", file="harbour", robots=4, swath_m=40.0,
        starts_lonlat=(
            (10.999878, 58.000817), (11.001793, 58.002382), (10.999591, 58.001567),
            (11.000482, 58.00213),
        ),
    ),
    Case(
        name="moose-4", title="Moose Lake, 4 landings", file="moose_lake", robots=4, swath_m=60.0,
        starts_lonlat=(
            (-118.63704, 36.599027), (-118.635657, 36.59919), (-118.635357, 36.599714),
            (-118.636335, 36.599049),
        ),
    ),
    Case(
        name="moose-berths", title="Moose Lake, berths 15 m apart", file="moose_lake", robots=4,
        swath_m=60.0,
    ),
    Case(
        name="harbour-berths", title="Harbour, berths 15 m apart", file="harbour", robots=4,
        swath_m=40.0,
    ),
)  # fmt: skip


def random_case(number: int) -> Case:
    """Return a fleet of two to four boats from landings along the shore of the harbour, by lot."""
    rng = np.random.default_rng(number)
    robots = 2 + number % 3
    area = _area(CASES[0])
    frame = LocalFrame.of(area)
    water = project_polygons(area.water_lonlat, frame)
    shore = max(shapely.get_parts(water.buffer(-11.0)), key=lambda part: part.area).exterior
    along_m = rng.uniform(0.0, shore.length) + rng.uniform(25.0, 90.0) * rng.permutation(robots)
    places = shapely.line_interpolate_point(shore, along_m % shore.length)
    lonlat = np.round(frame.to_lonlat(shapely.get_coordinates(places)), 6)
    return Case(
        name=f"random-{number}", title="Harbour, landings by lot", file="harbour", robots=robots,
        swath_m=40.0, starts_lonlat=tuple((float(x), float(y)) for x, y in lonlat),
    )  # fmt: skip


def _area(case: Case) -> SurveyArea:
    return read_survey_area(GEOFENCES / f"{case.file}.geojson", part=None, islands=False)


def options_of(case: Case, separation_m: float) -> PlanOptions:
    """Return the options of a fleet."""
    return PlanOptions(
        robots=case.robots,
        swath_m=case.swath_m,
        starts_lonlat=case.starts_lonlat,
        separation_m=separation_m,
        wait_in_mission=True,
        time_budget_s=0.2,
    )


def predicted_m(result: FleetPlan, options: PlanOptions, *, exact: bool) -> dict[str, float]:
    """Return how near each two robots come as predicted, by pair; times right, or wrong."""
    asked = PlanOptions()
    rules = SeparationRules(
        distance_m=asked.separation_m,
        time_share=0.0 if exact else asked.time_uncertainty,
        start_slack_s=0.0 if exact else SeparationRules().start_slack_s,
    )
    lines = [timeline(p, time_model(options.of_robot(p.robot))) for p in result.paths]
    starts = np.array([row.start_delay_s for row in result.report.robots])
    least_m = measure(lines, starts, rules).least_m
    robots = [line.robot for line in lines]
    return {
        f"{a}-{b}": float(least_m[i, j])
        for i, a in enumerate(robots)
        for j, b in enumerate(robots)
        if i < j
    }


def voyage(case: Case, separation_m: float, engine: str, out: Path) -> None:
    """Plan, sail, measure, and keep the results."""
    options = options_of(case, separation_m)
    result = plan(_area(case), options)
    speedup = min(80.0, BOATS_TIMES_SPEEDUP[engine] / case.robots)
    waters = Waters(engine=engine, speedup=speedup)
    name = f"{case.name}-{separation_m:g}-{engine}"
    tracks = asyncio.run(
        sail_missions(
            sailing_missions(result.missions),
            waters,
            stage=lambda text: _say(f"{name}: {text}"),
        )
    )
    driven = judge(
        result,
        tracks,
        limits=Limits(cross_track_m=case.swath_m / 10),
        delays_s={row.robot: row.start_delay_s for row in result.report.robots},
        waters=waters.as_dict(),
    )
    folder = out / name
    write_rehearsal(driven, tracks, folder, overwrite=True)
    found = {
        "delays_s": [row.start_delay_s for row in result.report.robots],
        "durations_s": [row.duration_s for row in result.report.robots],
        "turned": result.report.separation.turned,
        "times_right_m": predicted_m(result, options, exact=True),
        "times_wrong_m": predicted_m(result, options, exact=False),
    }
    text = json.dumps(plain(found), indent=2, sort_keys=True) + "\n"
    (folder / "predicted.json").write_text(text, "utf-8")


def _say(text: str) -> None:
    sys.stderr.write(text + "\n")


def _least(values: Sequence[float]) -> str:
    return f"{min(values):.1f}" if values else "–"


def cells(case: Case, separation_m: float, out: Path) -> list[str] | None:
    """Return one row of the table; None where neither engine has sailed."""
    nearest: dict[str, str] = {}
    off: dict[str, str] = {}
    short_m: list[float] = []
    found: dict[str, Any] = {}
    for engine in ENGINES:
        folder = out / f"{case.name}-{separation_m:g}-{engine}"
        if not (folder / "predicted.json").exists():
            continue
        driven = json.loads((folder / "rehearse.json").read_text("utf-8"))
        found = json.loads((folder / "predicted.json").read_text("utf-8"))
        met = {
            "-".join(map(str, p["robots"])): p["driven"]["distance_m"]
            for p in driven["pairs"]
            if p["driven"] is not None
        }
        home = all(row["home"] for row in driven["robots"])
        nearest[engine] = _least(list(met.values())) if home else "not all home"
        ratios = [row["driven_s"] / row["planned_s"] - 1 for row in driven["robots"] if row["home"]]
        off[engine] = f"{min(ratios):+.1%} … {max(ratios):+.1%}" if ratios else "–"
        promise = found["times_wrong_m"]
        short_m += [promise[pair] - met_m for pair, met_m in met.items()]
    if not found:
        return None
    return [
        f"{case.title}, {case.robots}, {case.swath_m:g} m",
        f"{separation_m:g} m",
        ", ".join(f"{d:.0f}" for d in found["delays_s"]),
        f"{max(found['durations_s']):.0f} s",
        _least(list(found["times_right_m"].values())),
        _least(list(found["times_wrong_m"].values())),
        *(nearest.get(engine, "–") for engine in ENGINES),
        f"{max(short_m):.1f} m" if max(short_m, default=0.0) > 0 else "–",
        *(off.get(engine, "–") for engine in ENGINES),
    ]


def table(out: Path) -> str:
    """Return the Markdown table of what a folder holds."""
    head = [
        "area, k, swath", "`--separation`", "delays s", "longest tour",
        "predicted, times right", "predicted, ±5 %", "light boats", "ArduRover",
        "any pair nearer than ±5 % by", "driven / predicted time: light", "ArduRover",
    ]  # fmt: skip
    rows = [head, ["---"] * len(head)]
    for case in CASES:
        rows += [row for s in (0.0, PlanOptions().separation_m) if (row := cells(case, s, out))]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def lots(out: Path) -> str:
    """Return what the fleets with landings by lot brought, a Markdown table."""
    head = [
        "engine", "`--separation`", "fleets", "pairs", "20 m apart with ±5 %",
        "… of these nearer when sailed", "all pairs nearer when sailed", "nearest two",
    ]  # fmt: skip
    rows = [head, ["---"] * len(head)]
    asked_m = PlanOptions().separation_m
    for engine in ENGINES:
        for separation_m in (0.0, asked_m):
            both: list[tuple[float, float]] = []
            folders = sorted(out.glob(f"random-*-{separation_m:g}-{engine}"))
            for folder in folders:
                driven = json.loads((folder / "rehearse.json").read_text("utf-8"))
                found = json.loads((folder / "predicted.json").read_text("utf-8"))
                for pair in driven["pairs"]:
                    promise = found["times_wrong_m"]["-".join(map(str, pair["robots"]))]
                    if pair["driven"] is not None:
                        both.append((promise, pair["driven"]["distance_m"]))
            if not folders:
                continue
            kept = [met for promise, met in both if promise >= asked_m]
            rows.append(
                [
                    engine,
                    f"{separation_m:g} m",
                    str(len(folders)),
                    str(len(both)),
                    str(len(kept)),
                    str(sum(met < asked_m for met in kept)),
                    str(sum(met < asked_m for _, met in both)),
                    f"{min(met for _, met in both):.1f} m",
                ]
            )
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def main() -> None:
    """Sail what is asked for, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--case", choices=[case.name for case in CASES], action="append")
    parser.add_argument("--engine", choices=ENGINES, action="append")
    parser.add_argument("--random", type=int, default=0, metavar="N")
    parser.add_argument("--table", action="store_true")
    given = parser.parse_args()
    if not given.table:
        for engine in given.engine or ENGINES:
            for case in map(random_case, range(given.random)) if given.random else CASES:
                if given.random or case.name in (given.case or [case.name]):
                    for separation_m in (0.0, PlanOptions().separation_m):
                        voyage(case, separation_m, engine, given.out)
    sys.stdout.write(table(given.out) + "\n\n" + lots(given.out) + "\n")


if __name__ == "__main__":
    main()
