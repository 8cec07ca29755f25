"""Where the robots of a folder of plans start: the homes of their first sorties."""

from __future__ import annotations

import json
import math
from pathlib import Path

from mrmission.errors import InputError

_TOGETHER_M = 1.0


def plan_homes(folder: Path) -> tuple[tuple[float, float], ...]:
    """Return one home per robot, in the order of the robots.

    Where the plans give several robots one home, these lie side by side from there, as boats do
    that can't lie on one point.

    Parameters
    ----------
    folder : Path
        Holds ``robot-*.plan`` files, as ``mrmission plan`` leaves them.

    Returns
    -------
    tuple of (lon, lat)
        Degrees.

    Raises
    ------
    InputError
        When there are no plans.
    PlanFormatError
        When one cannot be read.
    """
    from mrmission.mission.files import plan_files
    from mrmission.mission.qgc_plan import read_plan
    from mrmission.simulate.fleet import berths_lonlat
    from mrmission.simulate.motion import offset_m

    if not folder.is_dir():
        raise InputError(f"--for {folder}: is not a folder; name one that `mrmission plan` left")
    first: dict[int, Path] = {}
    for robot, _, path in plan_files(folder):
        first.setdefault(robot, path)
    if not first:
        raise InputError(
            f"--for {folder}: holds no robot-1.plan; name a folder that `mrmission plan` left"
        )
    homes: list[tuple[float, float]] = []
    for path in first.values():
        # Read as a plan for the checks; the mission of a robot without work keeps no home.
        read_plan(path)
        home = json.loads(path.read_text())["mission"]["plannedHomePosition"]
        homes.append((float(home[1]), float(home[0])))
    apart: list[tuple[float, float]] = []
    for lon, lat in homes:
        for berth in berths_lonlat((lon, lat), len(homes)):
            if all(
                math.hypot(*offset_m(berth[1], berth[0], other[1], other[0])) > _TOGETHER_M
                for other in apart
            ):
                apart.append(berth)
                break
    return tuple(apart)
