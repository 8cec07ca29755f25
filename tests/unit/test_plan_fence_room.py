"""A fence leaves room for the swing of a boat with a rudder, where the water has it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from mrmission.area.frame import LocalFrame
from mrmission.area.geojson import read_survey_area
from mrmission.model import FleetPlan
from mrmission.options import REVERSAL_M, PlanOptions
from mrmission.pipeline import plan


@pytest.mark.parametrize(
    ("steering", "vehicle", "clearance_m", "room_m"),
    [
        ("steered", "boat", 10.0, 5.0),
        ("steered", "boat", 3.0, 2.0),
        ("steered", "boat", 50.0, REVERSAL_M),
        ("steered", "rover", 10.0, 5.0),
        ("pivoting", "boat", 10.0, 2.0),
        ("steered", "copter", 10.0, 2.0),
    ],
)
def test_room(steering: str, vehicle: str, clearance_m: float, room_m: float) -> None:
    options = PlanOptions(steering=steering, vehicle=vehicle, clearance_m=clearance_m)
    assert options.fence_room_m == room_m


def nearest_m(made: FleetPlan) -> float:
    """Return the least distance of a robot's way from its fence, by plain geometry."""
    frame, out = LocalFrame.of(made.area), []
    for path, mission in zip(made.paths, made.missions, strict=True):
        way = shapely.LineString(path.points_m)
        for polygon in mission.fence:
            lonlat = np.array(polygon.points_e7)[:, ::-1] / 1e7
            ring = shapely.LinearRing(frame.to_metric(lonlat))
            out.append(float(shapely.distance(way, ring)))
    return min(out)


def test_a_steered_boat_has_more_of_it(geofences: Path) -> None:
    area = read_survey_area(geofences / "demo_lake.geojson", part=None, islands=False)
    common = {"robots": 2, "swath_m": 60.0, "clearance_m": 10.0}
    steered = nearest_m(plan(area, PlanOptions(**common)))  # type: ignore[arg-type]
    pivoting = nearest_m(plan(area, PlanOptions(**common, steering="pivoting")))  # type: ignore[arg-type]
    assert steered > 4.9
    assert 1.9 < pivoting < 4.9
