"""Exported routes: no coordinate of 0, which mission items cannot tell from one not given."""

from __future__ import annotations

import numpy as np
import shapely

from mrmission.model import SurveyArea
from mrmission.options import PlanOptions
from mrmission.pipeline import plan


def test_a_lake_on_the_equator_and_at_greenwich_has_no_coordinate_of_zero() -> None:
    # corners on the equator and at Greenwich, so that lanes and ways end there
    lake = shapely.box(-0.002, -0.0015, 0.002, 0.0015)
    island = shapely.box(-0.0005, 0.0, 0.0, 0.0004)
    area = SurveyArea(
        name="zero", source="zero",
        water_lonlat=shapely.MultiPolygon([shapely.difference(lake, island)]),
    )  # fmt: skip
    options = PlanOptions(
        robots=2, swath_m=20.0, clearance_m=0.0, angle_deg=0.0, time_budget_s=0.1, fence=False,
        starts_lonlat=((0.0, 0.0015),),
    )  # fmt: skip
    result = plan(area, options)
    places = np.array([(i.x, i.y) for m in result.missions for i in m.items if i.command == 16])
    assert len(places) > 20
    assert (np.abs(places) <= 1).any()  # some lie there
    assert (places != 0).all()
    assert result.report.coverage > 0.9995
