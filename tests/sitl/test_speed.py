"""The speeds that a mission orders are the speeds that a boat sails: light boats and ArduRover."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from fleets import Engine

from mrmission.calibrate.sailing import track_in_course
from mrmission.mission.items import build_items
from mrmission.model import LegKind, Mission
from mrmission.options import PlanOptions
from mrmission.rehearse.pilot import SailOrders, sail
from mrmission.rehearse.track import Track
from mrmission.simulate.motion import moved
from mrmission.vehicle.client import open_links
from mrmission.vehicle.connection import parse_connections
from mrmission.vehicle.items import MissionType, mission_to_raw
from mrmission.vehicle.links import LinkTimeouts

LEG_M = 60.0
SETTLED = (0.4, 0.9)
"""The part of a leg on which its speed is reached and the next corner not yet felt."""
CORNERS_M = np.array([[0.0, 0], [0, LEG_M], [LEG_M, LEG_M], [LEG_M, 0], [0, 0]])
KIND = np.array(
    [LegKind.TRANSIT, LegKind.SURVEY, LegKind.TRANSIT, LegKind.SURVEY], dtype=np.int8
)  # fmt: skip


async def sailed(engine: Engine, options: PlanOptions, **parameters: float) -> list[float]:
    """Sail a square of two transits and two lanes; return the settled speed on each leg."""
    async with engine.fleet(parameters=parameters, speedup=60.0 if engine.light else 10.0) as fleet:
        lon, lat = fleet.starts_lonlat[0]
        there = [moved(lat, lon, east, north) for east, north in CORNERS_M.tolist()]
        path = np.round(np.array([(x, y) for y, x in there]), 7)
        items, _, _ = build_items(path, KIND, np.array([0, 1, 0, 2]), options)
        mission = Mission(
            robot=1, sortie=1, vehicle="boat", items=items, fence=(), rally=(),
        )  # fmt: skip
        async with open_links(
            parse_connections(fleet.links), expected=1, timeouts=LinkTimeouts()
        ) as links:
            boat = links.vehicles[fleet.system_ids[0]]
            await boat.upload(MissionType.MISSION, mission_to_raw(items))
            track = await sail(boat, mission, SailOrders(sample_s=0.2))
    assert track.home, track.end_text
    return leg_speeds(track, (lon, lat))


def leg_speeds(track: Track, origin_lonlat: tuple[float, float]) -> list[float]:
    under_way = track.under_way()
    points, time = track_in_course(track, origin_lonlat)[under_way], track.time_s[under_way]
    out, start = [], 0
    for a, b in pairwise(CORNERS_M):
        off = (points[start:] - a) @ ((b - a) / LEG_M)
        near = np.abs((points[start:] - a) @ np.array([[0.0, 1.0], [-1.0, 0.0]]) @ (b - a)) / LEG_M
        on_leg = (off >= SETTLED[0] * LEG_M) & (off <= SETTLED[1] * LEG_M) & (near < 5.0)
        index = start + np.flatnonzero(on_leg)
        first, last = index[0], index[-1]
        # the last leg of the square crosses none of the others, so nothing is found twice
        way = np.hypot(*np.diff(points[first : last + 1], axis=0).T).sum()
        out.append(float(way / (time[last] - time[first])))
        start = last
    return out


async def test_survey_and_transit_speeds_are_reached(engine: Engine) -> None:
    """WP_SPEED is neither: the mission's own speeds count, on every leg of their kind."""
    options = PlanOptions(survey_speed_m_s=1.5, transit_speed_m_s=3.0)
    speeds = await sailed(engine, options, WP_SPEED=2.0, WP_RADIUS=1.0)
    assert speeds == pytest.approx([3.0, 1.5, 3.0, 1.5], rel=0.05)


async def test_speed_max_limits_a_mission(engine: Engine) -> None:
    """SPEED_MAX below the speed ordered wins, which is why preflight looks at it."""
    options = PlanOptions(survey_speed_m_s=3.0, transit_speed_m_s=3.0)
    speeds = await sailed(engine, options, SPEED_MAX=2.0, CRUISE_SPEED=5.0)
    assert speeds == pytest.approx([2.0] * 4, rel=0.05)
