"""The trips of one robot as one route that comes home in between, and as trips again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrmission.mission.build import Route


def joined(routes: Sequence[Route]) -> Route:
    """Return the trips of one robot as one route that comes home in between."""
    if len(routes) == 1:
        return routes[0]
    first = routes[0].path
    lanes, before = [], 0
    for route in routes:
        lane = route.path.lane
        lanes.append(np.where(lane > 0, lane + before, 0))
        before += int(lane.max(initial=0))
    rest = routes[1:]
    return Route(
        lonlat=np.concatenate([routes[0].lonlat, *(r.lonlat[1:] for r in rest)]),
        path=replace(
            first,
            points_m=np.concatenate([first.points_m, *(r.path.points_m[1:] for r in rest)]),
            kind=np.concatenate([r.path.kind for r in routes]),
            lane=np.concatenate(lanes),
        ),
    )


def parted(route: Route, legs: Sequence[int], turned: bool) -> list[Route]:
    """Return a joined route as trips again.

    Parameters
    ----------
    route
        What :func:`joined` made, or the same the other way round.
    legs
        How many legs each trip has, as they were joined.
    turned
        Whether it is the other way round: then the last trip comes first.
    """
    out, at = [], 0
    for count in reversed(legs) if turned else legs:
        lane = route.path.lane[at : at + count]
        offset = int(lane[lane > 0].min(initial=np.iinfo(np.int64).max)) - 1
        out.append(
            Route(
                lonlat=route.lonlat[at : at + count + 1],
                path=replace(
                    route.path,
                    points_m=route.path.points_m[at : at + count + 1],
                    kind=route.path.kind[at : at + count],
                    lane=np.where(lane > 0, lane - offset, 0),
                ),
            )
        )
        at += count
    return out
