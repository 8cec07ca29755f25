"""One small plan as it was: the numbers of its report, and where its robots go.

Another build of GEOS or numpy may move a waypoint by a rounding, so positions are compared to
1e-6 degrees (a decimetre) and numbers to six digits, not byte by byte. After a change that is meant
to change plans, write the file anew and look at the difference before committing it:

    MRMISSION_WRITE_GOLDEN=1 pytest tests/golden/test_plan_golden.py
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest
import shapely

from mrmission.model import FleetPlan, SurveyArea
from mrmission.options import PlanOptions
from mrmission.pipeline import plan

GOLDEN = Path(__file__).with_name("small_lake.json")
SHORE = [
    (11.2000, 47.8000), (11.2019, 47.7996), (11.2036, 47.8001), (11.2041, 47.8013),
    (11.2032, 47.8024), (11.2021, 47.8021), (11.2010, 47.8027), (11.1998, 47.8018),
]  # fmt: skip
ISLAND = [(11.2015, 47.8008), (11.2022, 47.8007), (11.2024, 47.8013), (11.2017, 47.8014)]


def small_lake() -> SurveyArea:
    water = shapely.MultiPolygon([shapely.Polygon(SHORE, [ISLAND])])
    return SurveyArea(name="small lake", source="small_lake", water_lonlat=water)


def picture(result: FleetPlan) -> dict[str, Any]:
    """What is kept of a plan."""
    report = result.report
    return {
        "method": report.method,
        "numbers": {
            name: float(f"{getattr(report, name):.9g}")
            for name in (
                "makespan_s",
                "lower_bound_s",
                "gap",
                "utilization",
                "coverage",
                "coverage_survey_legs",
                "coverage_of_area",
                "area_m2",
                "navigable_m2",
                "unreached_m2",
                "angle_deg",
                "lane_spacing_m",
            )
        },
        "robots": [
            {
                "length_m": float(f"{row.length_m:.9g}"),
                "survey_m": float(f"{row.survey_m:.9g}"),
                "duration_s": float(f"{row.duration_s:.9g}"),
                "lanes": row.lanes,
                "items": [[i.command, i.frame, i.x, i.y] for i in mission.items],
                "fence": [p.points_e7.tolist() for p in mission.fence],
                "rally": [[r.lat_e7, r.lon_e7] for r in mission.rally],
            }
            for row, mission in zip(report.robots, result.missions, strict=True)
        ],
    }


def test_the_plan_is_as_it_was() -> None:
    options = PlanOptions(robots=2, swath_m=25.0, clearance_m=6.0)
    got = picture(plan(small_lake(), options))
    if os.environ.get("MRMISSION_WRITE_GOLDEN"):
        text = json.dumps(got, indent=1)
        GOLDEN.write_text(text + "\n", encoding="utf-8")
    expected = json.loads(GOLDEN.read_text(encoding="utf-8"))
    assert got["method"] == expected["method"]
    for name, value in expected["numbers"].items():
        assert got["numbers"][name] == pytest.approx(value, rel=1e-6, abs=1e-6), name
    assert len(got["robots"]) == len(expected["robots"])
    for mine, old in zip(got["robots"], expected["robots"], strict=True):
        for name in ("length_m", "survey_m", "duration_s"):
            assert mine[name] == pytest.approx(old[name], rel=1e-6), name
        assert mine["lanes"] == old["lanes"]
        for name in ("items", "fence", "rally"):
            assert flat(mine[name]) == pytest.approx(flat(old[name]), rel=0, abs=10), name


def flat(rows: Any) -> list[int]:
    """All the integers of nested lists, with the length of each list before it."""
    if not isinstance(rows, list):
        return [rows]
    # lengths times 100, so that a point more or less can't pass as a rounding
    return [100 * len(rows), *(n for row in rows for n in flat(row))]
