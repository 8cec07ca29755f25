"""Who gets which tour: robots to vehicles, and of several sorties which one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mrmission.errors import ConfigError
from mrmission.model import Mission


def first_sorties(missions: Sequence[Mission]) -> list[Mission]:
    """Return each robot's first sortie, by robot number."""
    out: dict[int, Mission] = {}
    for mission in missions:
        if mission.robot not in out or mission.sortie < out[mission.robot].sortie:
            out[mission.robot] = mission
    return [out[robot] for robot in sorted(out)]


def sorties_numbered(missions: Sequence[Mission], sortie: int) -> list[Mission]:
    """Return the sortie of a number of each robot that goes out so often, by robot number.

    Sortie 1 is the first of each robot.

    Raises
    ------
    ConfigError
        When no robot goes out so often.
    """
    if sortie == 1:
        return first_sorties(missions)
    found = sorted((m for m in missions if m.sortie == sortie), key=lambda m: m.robot)
    if not found:
        most = max((m.sortie for m in missions), default=1)
        raise ConfigError(
            f"--sortie {sortie}: no robot goes out so often; the plan has "
            + (f"{most} sorties at the most" if most > 1 else "one sortie for each robot")
        )
    return found


def carried_sorties(missions: Sequence[Mission], sorties: Mapping[int, int]) -> list[Mission]:
    """Return one mission of each robot: the sortie that its vehicle has, else its first.

    Parameters
    ----------
    missions
        All of a plan.
    sorties
        Robot to the sortie that was uploaded to its vehicle.
    """
    theirs = {m.robot: m for m in missions if sorties.get(m.robot) == m.sortie}
    return [theirs.get(m.robot, m) for m in first_sorties(missions)]


def assign(
    robots: Sequence[int], system_ids: Sequence[int], previous: Mapping[int, int] | None = None
) -> dict[int, int]:
    """Say which vehicle gets which robot's tour; never depends on the order of discovery.

    A pair of an earlier run stays together while its vehicle is there, so that a second run
    completes the first. Where every system id is a robot's number, robot r is vehicle r, and the
    one that is missing is missed under its own number. Otherwise the robots, ascending, get the
    vehicles, ascending.

    Parameters
    ----------
    robots, system_ids
        Who is to be paired; in any order.
    previous
        Robot to system id of an earlier run.

    Returns
    -------
    dict
        Robot to system id; a robot without a vehicle is left out.

    Examples
    --------
    >>> assign([1, 2, 3], [23, 21, 22])
    {1: 21, 2: 22, 3: 23}
    >>> assign([1, 2, 3], [1, 3])
    {1: 1, 3: 3}
    >>> assign([1, 2, 3], [21, 22, 23], {1: 21, 2: 23})
    {1: 21, 2: 23, 3: 22}
    """
    out = {
        robot: system_id
        for robot, system_id in sorted((previous or {}).items())
        if robot in robots and system_id in system_ids
    }
    free_robots = sorted(set(robots) - set(out))
    free_ids = sorted(set(system_ids) - set(out.values()))
    if set(free_ids) <= set(free_robots):
        out.update({system_id: system_id for system_id in free_ids})
    else:
        out.update(zip(free_robots, free_ids, strict=False))
    return dict(sorted(out.items()))
