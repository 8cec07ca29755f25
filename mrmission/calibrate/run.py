"""The experiment: fleets are started, every boat takes the next course until none is left."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mrmission.calibrate.courses import (
    ANGLES_DEG,
    SPACINGS_M,
    Course,
    corner_course,
    speed_course,
)
from mrmission.calibrate.measure import CourseResult
from mrmission.calibrate.sailing import Setting, sail_course
from mrmission.calibrate.table import changes_of, make_table, merged
from mrmission.errors import ConfigError, SimulatorError, VehicleError
from mrmission.tour.time_table import SpeedChange, TimeRow, TimeTable

if TYPE_CHECKING:
    from mrmission.vehicle.client import Vehicle

MODELS: Mapping[str, str] = {"steered": "motorboat", "pivoting": "pivoting"}
"""Which simulated boat is sailed for a steering type."""
HOME_LONLAT = (8.53, 47.28)
BERTH_M = 1000.0
LEAST_SPEED_SHARE = 0.95
"""Of the speed ordered that a boat must reach on the run-in for its course to count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """What is sailed.

    Attributes
    ----------
    steerings, speeds_m_s, radii_m
        Every combination is one course.
    repeats
        How often every manoeuvre is sailed to each side.
    angles_deg, spacings_m
        Of the corners and of the short legs.
    """

    steerings: tuple[str, ...] = ("steered", "pivoting")
    speeds_m_s: tuple[float, ...] = (1.0, 2.0, 3.0, 5.0)
    radii_m: tuple[float, ...] = (1.0, 2.0, 3.0)
    repeats: int = 2
    angles_deg: tuple[float, ...] = ANGLES_DEG
    spacings_m: tuple[float, ...] = SPACINGS_M

    def __post_init__(self) -> None:
        for flag, values in (("--speed", self.speeds_m_s), ("--wp-radius", self.radii_m)):
            for value in values:
                if not 0 < value <= 20:
                    raise ConfigError(f"{flag} {value:g}: must be above 0 and at most 20")
        for speed in self.speeds_m_s:
            self.course(speed)

    def course(self, speed_m_s: float) -> Course:
        """Return the course of corners at a speed."""
        return corner_course(
            speed_m_s, repeats=self.repeats, angles_deg=self.angles_deg,
            spacings_m=self.spacings_m,
        )  # fmt: skip

    def extent_m(self) -> tuple[float, float]:
        """Return the width east and north of the largest course, with room for the turns."""
        sides = [np.ptp(self.course(speed).points_m, axis=0) for speed in self.speeds_m_s]
        east, north = np.max(sides, axis=0) + 20.0
        return float(east), float(north)

    def command(self, engine: str) -> str:
        """Return the command that does this experiment."""
        words = ["mrmission calibrate"]
        words += [f"--steering {name}" for name in self.steerings]
        words += [f"--speed {value:g}" for value in self.speeds_m_s]
        words += [f"--wp-radius {value:g}" for value in self.radii_m]
        words += [f"--repeats {self.repeats}"]
        if self.angles_deg != ANGLES_DEG:
            words += [f"--angle {value:g}" for value in self.angles_deg]
        if self.spacings_m != SPACINGS_M:
            words += [f"--spacing {value:g}" for value in self.spacings_m]
        words += ["--connect ..." if engine == "connect" else f"--engine {engine}"]
        return " ".join(words)

    def tasks(self, steering: str) -> list[_Task]:
        """Return the courses of a steering type, the longest first."""
        speeds = sorted(set(self.speeds_m_s))
        tasks = [
            _Task(
                setting=Setting(steering=steering, speed_m_s=speed, radius_m=radius),
                course=self.course(speed),
            )
            for speed in speeds
            for radius in sorted(set(self.radii_m))
        ]
        radius = min(self.radii_m)
        tasks += [
            _Task(
                setting=Setting(steering=steering, speed_m_s=fast, radius_m=radius),
                course=speed_course(slow, fast, repeats=self.repeats),
                changes=True,
            )
            for slow, fast in itertools.pairwise(speeds)
        ]
        return sorted(tasks, key=lambda t: -t.course.shortest_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Task:
    setting: Setting
    course: Course
    changes: bool = False
    tries: int = 3

    @property
    def name(self) -> str:
        what = "changes of speed" if self.changes else "corners"
        s = self.setting
        return f"{s.steering} {s.speed_m_s:g} m/s, WP_RADIUS {s.radius_m:g}: {what}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Engine:
    """What sails: boats that are started for it, or boats that are there.

    Attributes
    ----------
    name
        ``ardupilot``, ``light``, or ``connect`` for boats behind `connections`.
    boats
        How many are started.
    speedup
        Seconds on the water per second.
    connections
        Links to boats that are there.
    base_port
        First TCP port of boats that are started; 0 takes free ones.
    """

    name: str = "ardupilot"
    boats: int = 2
    speedup: float = 10.0
    connections: tuple[str, ...] = ()
    base_port: int = 0


async def run_experiment(
    experiment: Experiment,
    engine: Engine,
    *,
    command: str,
    have: TimeTable | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> tuple[TimeTable, list[str]]:
    """Sail every course that a table does not have yet; return the table and what is missing.

    Boats that are started for it belong to the simulator; boats behind `connections` are armed and
    sail off at once, so whoever calls this has asked for that.

    Raises
    ------
    VehicleError
        When the boats cannot be started.
    """
    known = set() if have is None else {_setting(row) for row in have.rows}
    failed: list[str] = []
    results: dict[Setting, CourseResult] = {}
    changes: list[SpeedChange] = []
    versions: list[str] = []
    for steering in experiment.steerings:
        tasks = [t for t in experiment.tasks(steering) if t.changes or t.setting not in known]
        async with _vehicles(engine, steering) as vehicles:
            versions.append(await _version(vehicles[0], engine, steering))

            async def work(vehicle: Vehicle, tasks: list[_Task] = tasks) -> None:
                while tasks:
                    task = tasks.pop(0)
                    try:
                        result = await _sail(vehicle, task, say)
                    except VehicleError as error:
                        say(f"{task.name}: {error}")
                        if task.tries > 1:
                            tasks.append(replace(task, tries=task.tries - 1))
                        else:
                            failed.append(f"{task.name}: {error}")
                        if isinstance(error, SimulatorError):
                            # a boat that does not sail is left alone; others take its courses
                            return
                        continue
                    if not result.speed_share >= LEAST_SPEED_SHARE:
                        # what a corner costs over a speed that is not reached, means nothing
                        failed.append(
                            f"{task.name}: it does not reach its speed, only "
                            f"{100 * result.speed_share:.0f} % of it after the run-in"
                        )
                    elif task.changes:
                        changes.extend(changes_of(task.setting.steering, task.course, result))
                    else:
                        results[task.setting] = result

            await asyncio.gather(*(work(vehicle) for vehicle in vehicles))
            failed.extend(f"{task.name}: no boat is left to sail it" for task in tasks)
    changes.sort(key=lambda c: (c.steering != "steered", c.from_m_s, c.to_m_s))
    table = make_table(
        results, changes, vehicle="; ".join(dict.fromkeys(versions)), command=command,
        repeats=experiment.repeats,
    )  # fmt: skip
    return (table if have is None else merged(have, table)), failed


def _setting(row: TimeRow) -> Setting:
    return Setting(steering=row.steering, speed_m_s=row.speed_m_s, radius_m=row.radius_m)


async def _sail(vehicle: Vehicle, task: _Task, say: Callable[[str], None]) -> CourseResult:
    origin = vehicle.position_lonlat()
    if origin is None:
        await vehicle.message("GLOBAL_POSITION_INT", 10.0)
        origin = vehicle.position_lonlat()
    if origin is None:
        raise VehicleError(f"{vehicle.where()}: says no position")
    speed = task.course.speed_m_s[0] if task.changes else task.setting.speed_m_s
    result, track = await sail_course(
        vehicle,
        task.course,
        origin,
        {"WP_SPEED": float(speed), "WP_RADIUS": task.setting.radius_m},
    )
    say(
        f"{task.name}: {task.course.length_m:.0f} m in {track.duration_s:.0f} s, "
        f"length / speed {task.course.shortest_s:.0f} s"
    )
    return result


@contextlib.asynccontextmanager
async def _vehicles(engine: Engine, steering: str) -> AsyncIterator[list[Vehicle]]:
    """Start the boats of a steering type, or open the links to those that are there."""
    from mrmission.vehicle.client import open_links
    from mrmission.vehicle.connection import parse_connections
    from mrmission.vehicle.links import LinkTimeouts

    async with contextlib.AsyncExitStack() as stack:
        links: Sequence[str] = engine.connections
        if engine.name != "connect":
            fleet = await stack.enter_async_context(_fleet(engine, steering))
            links = fleet.links
        found = await stack.enter_async_context(
            open_links(parse_connections(list(links)), expected=len(links), timeouts=LinkTimeouts())
        )
        if not found.vehicles:
            raise VehicleError(f"no vehicle answers on {', '.join(links)}")
        for vehicle in found.vehicles.values():
            await vehicle.wait_heartbeat()
        yield [found.vehicles[number] for number in sorted(found.vehicles)]


def _fleet(engine: Engine, steering: str) -> Any:
    """Return a fleet of simulated boats, not started yet; each has a kilometre of water."""
    if engine.name == "ardupilot":
        from mrmission.simulate.ardupilot import ArdupilotFleet

        return ArdupilotFleet(
            count=engine.boats, home_lonlat=HOME_LONLAT, spacing_m=BERTH_M,
            model=MODELS[steering], speedup=engine.speedup, base_port=engine.base_port,
        )  # fmt: skip
    if engine.name == "light":
        from mrmission.simulate import SimulatedFleet

        return SimulatedFleet(
            count=engine.boats, home_lonlat=HOME_LONLAT, spacing_m=BERTH_M,
            speedup=engine.speedup, base_port=engine.base_port,
        )  # fmt: skip
    raise ConfigError(f"--engine {engine.name}: must be ardupilot or light")


async def _version(vehicle: Vehicle, engine: Engine, steering: str) -> str:
    if engine.name == "light":
        return "mrmission's light boats"
    version = int((await vehicle.autopilot_version()).flight_sw_version)
    number = ".".join(str(version >> shift & 0xFF) for shift in (24, 16, 8))
    release = {0: "-dev", 64: "-alpha", 128: "-beta", 192: "-rc", 255: ""}.get(version & 0xFF, "")
    where = f" ({MODELS[steering]} in SITL)" if engine.name == "ardupilot" else ""
    return f"ArduRover {number}{release}{where}"
