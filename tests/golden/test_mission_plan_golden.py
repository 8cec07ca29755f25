"""The bytes of a small boat's plan, and what the independent scorer reads in them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from mrmission.mission.items import build_items
from mrmission.mission.qgc_plan import plan_text, write_plan
from mrmission.mission.wpl import waypoints_text
from mrmission.model import FencePolygon, Mission, RallyPoint
from mrmission.options import PlanOptions

HERE = Path(__file__).parent


def boat() -> Mission:
    # three lanes in a rectangle of 0.001° x 0.003° at 50° N
    path = np.array(
        [[10.0002, 50.0002], [10.0002, 50.0028], [10.0005, 50.0028], [10.0005, 50.0002],
         [10.0008, 50.0002], [10.0008, 50.0028], [10.0002, 50.0002]]
    )  # fmt: skip
    items, kind, lane = build_items(
        path, np.array([1, 0, 1, 0, 1, 0]), np.array([1, 0, 2, 0, 3, 0]), PlanOptions()
    )
    ring = np.array([[500000000, 100000000], [500030000, 100000000], [500030000, 100010000],
                     [500000000, 100010000]])  # fmt: skip
    return Mission(
        robot=1, sortie=1, vehicle="boat", items=items, kind=kind, lane=lane,
        fence=(FencePolygon(inclusion=True, points_e7=ring),),
        rally=(RallyPoint(lat_e7=items[0].x, lon_e7=items[0].y),),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("name", "text"), [("boat.plan", plan_text), ("boat.waypoints", waypoints_text)]
)
def test_the_bytes_are_as_they_were(name: str, text) -> None:
    assert text(boat()) == (HERE / name).read_text()


def test_the_scorer_reads_the_plan(score_script: Path, tmp_path: Path) -> None:
    write_plan(boat(), tmp_path / "robot-1.plan")
    idle = Mission(robot=2, sortie=1, vehicle="boat", items=(), fence=(), rally=())
    write_plan(idle, tmp_path / "robot-2.plan", home_lonlat=(10.0002, 50.0002))
    ring = [[10, 50], [10.001, 50], [10.001, 50.003], [10, 50.003], [10, 50]]
    (tmp_path / "area.geojson").write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    plans = [str(tmp_path / f"robot-{r}.plan") for r in (1, 2)]
    command = [sys.executable, str(score_script), str(tmp_path / "area.geojson"), *plans,
               "--swath", "42", "--json"]  # fmt: skip
    score = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    assert score["closed_m"] == 0
    assert score["outside_m"] == 0
    assert score["robots"] == 2
    assert score["utilization"] == 0.5
    assert score["coverage"] > 0.98
