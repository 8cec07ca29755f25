"""Small missions for upload tests, all beside one home."""

from __future__ import annotations

import numpy as np

from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint

HOME = (8.5, 47.3)


def mission(robot: int, count: int = 14, shift: int = 0) -> Mission:
    """Return a mission of `count` items; another `shift`, another mission, fence and rally."""
    lat, lon = 473_000_000, 85_000_000

    def item(seq: int, command: int = 16, **changes: float) -> MissionItem:
        fields = {
            "seq": seq, "frame": 3 if seq else 0, "command": command, "current": int(seq == 0),
            "autocontinue": 1, "param1": 0.0, "param2": 0.0, "param3": 0.0, "param4": 0.0,
            "x": lat + 500 * seq + shift, "y": lon + 1000 * robot + 7 * seq, "z": 0.0,
        }  # fmt: skip
        return MissionItem(**{**fields, **changes})  # type: ignore[arg-type]

    items = [item(0), item(1), item(2, 178, param1=1.0, param2=2.0, param3=-1.0, x=0, y=0)]
    items += [item(seq) for seq in range(3, count - 1)]
    items.append(item(len(items), 17))
    box = np.array([[lat - 9000, lon], [lat + 90000, lon], [lat + 90000, lon + 90000]])
    island = np.array(
        [[lat + 8000, lon + 9000], [lat + 8900, lon + 9000], [lat + 8900, lon + 9900]]
    )
    return Mission(
        robot=robot,
        sortie=1,
        vehicle="boat",
        items=tuple(items),
        fence=(
            FencePolygon(inclusion=True, points_e7=box - shift),
            FencePolygon(inclusion=False, points_e7=island + robot),
        ),
        rally=(RallyPoint(lat_e7=lat + robot + shift, lon_e7=lon),),
    )


def missions(count: int, items: int = 14, shift: int = 0) -> list[Mission]:
    """Return a mission each for robots 1 to `count`."""
    return [mission(robot, items, shift) for robot in range(1, count + 1)]
