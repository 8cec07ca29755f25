"""The time model in a plan: steering and WP_RADIUS count, the swing is noted, a table is read."""

from __future__ import annotations

from pathlib import Path

import pytest
import shapely

from mrmission.cli.options import build_options
from mrmission.errors import ConfigError, InputError
from mrmission.model import FleetReport, SurveyArea
from mrmission.options import PlanOptions, VehicleLimits
from mrmission.pipeline import plan
from mrmission.tour.time_table import default_table, table_text

WATER = shapely.Polygon([(11.2, 47.8), (11.203, 47.8), (11.203, 47.8015), (11.2, 47.8015)])
AREA = SurveyArea(name="pond", source="pond", water_lonlat=shapely.MultiPolygon([WATER]))


def report(**options: object) -> FleetReport:
    wanted = {"swath_m": 20.0, "clearance_m": 0.0, "fence": False, "angle_deg": 0.0, **options}
    return plan(AREA, PlanOptions(**wanted)).report  # type: ignore[arg-type]


def test_who_stops_to_turn_takes_longer() -> None:
    steered, pivoting = report(), report(steering="pivoting")
    # two corners per lane of some 6 s each
    assert pivoting.makespan_s > steered.makespan_s + pivoting.robots[0].lanes * 5.0
    assert pivoting.lower_bound_s == pytest.approx(steered.lower_bound_s, rel=1e-3)
    assert pivoting.options["steering"] == "pivoting"
    assert pivoting.options["wp_radius_m"] == 1.0


def test_the_swing_is_noted_where_the_clearance_is_less() -> None:
    noted = [n for n in report().notes if "turns swing up to" in n]
    assert len(noted) == 1
    assert "steered at 2 m/s, WP_RADIUS 1" in noted[0]
    assert "--clearance is 0 m" in noted[0]
    assert not [n for n in report(clearance_m=12.0).notes if "turns swing" in n]


def test_a_table_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    text = table_text(default_table()).replace('"extra_s": ', '"extra_s": 1')
    path.write_text(text.replace("1-", "1"))  # every corner and turn costs more
    flags: dict[str, object] = {
        "swath_m": 20.0, "clearance_m": 0.0, "survey_speed_m_s": 2.0, "transit_speed_m_s": None,
        "angle_deg": 0.0, "fence": False, "vehicle": "boat",
        "max_items": VehicleLimits().mission_items, "fence_bytes": VehicleLimits().fence_bytes,
    }  # fmt: skip
    options = build_options(**flags, time_model=path)
    assert options.time_table is not None
    mine = plan(AREA, options).report
    assert mine.makespan_s > report().makespan_s + 10.0 * mine.robots[0].lanes
    assert mine.options["time_table"]["command"] == default_table().command
    with pytest.raises(InputError, match="time table"):
        build_options(**flags, time_model=tmp_path / "none.json")


@pytest.mark.parametrize(
    ("name", "value", "flag"),
    [("steering", "rudder", "--steering"), ("wp_radius_m", 0.0, "--wp-r")],
)
def test_options_out_of_range(name: str, value: object, flag: str) -> None:
    with pytest.raises(ConfigError, match=flag):
        PlanOptions(**{name: value})  # type: ignore[arg-type]
