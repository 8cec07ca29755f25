"""One test, two engines: light boats in ``make test``, ArduPilot's SITL in ``make test-sitl``.

A test asks for the fixture `engine`, and for a fleet of it:

    async def test_a_fleet_keeps_what_it_is_sent(engine: Engine) -> None:
        async with engine.fleet(count=2, parameters={"WP_SPEED": 3}) as fleet:
            rows = await upload_fleet(missions(2), fleet.links)

`fleet` is a :class:`SimulatedFleet` or an :class:`ArdupilotFleet`: both have `links`,
`system_ids`, `starts_lonlat`. Its boats are ready, in HOLD, with the parameters of ``sitl/*.parm``
and then the test's own, on free ports. Tests that wait should wait in simulated seconds:
``await engine.sleep(30.0)`` sleeps 30 s on the water.

A test whose boats neither move nor get other parameters may say ``fresh=False``: ArduPilot fleets
are then shared between such tests and emptied in between, instead of started anew (4 s and more).

A test for ArduPilot alone carries ``@pytest.mark.ardupilot`` (``program="arducopter"`` for
copters) and calls :func:`ardupilot` or uses :class:`ArdupilotFleet` itself. Where there is no
program, all of these are skipped, and the summary names them.
"""

from __future__ import annotations

import asyncio
import os
import shutil
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from mrmission.simulate import ArdupilotFleet, SimulatedFleet
from mrmission.simulate.ardupilot_models import MODELS, survey_parameters
from mrmission.simulate.ardupilot_process import PROGRAMS

HOME = (8.5, 47.3)
BUDGET = 24.0
"""Boats times speed-up that two cores carry with a test beside them."""
LIGHT_SPEEDUP = 10.0

Fleet = SimulatedFleet | ArdupilotFleet


def program_path(program: str) -> str | None:
    """Where an ArduPilot program is, if there is one."""
    return shutil.which(os.environ.get(program.upper()) or program)


def why_not(program: str) -> str:
    return (
        f"ARDUPILOT NOT TESTED: no {program} on PATH nor named by {program.upper()}"
        if program_path(program) is None
        else ""
    )


class Engine:
    """Where a test's fleet comes from.

    Attributes
    ----------
    name : str
        "light" or "ardupilot".
    speedup : float
        Of the fleet started last: simulated seconds per second.
    """

    def __init__(self, name: str, pool: Pool) -> None:
        self.name = name
        self.speedup = 1.0
        self._pool = pool

    @property
    def light(self) -> bool:
        return self.name == "light"

    @asynccontextmanager
    async def fleet(
        self,
        *,
        count: int = 1,
        home_lonlat: tuple[float, float] = HOME,
        starts_lonlat: Sequence[tuple[float, float]] | None = None,
        parameters: Mapping[str, float] | None = None,
        model: str = "motorboat",
        speedup: float | None = None,
        first_system_id: int = 1,
        folder: Path | None = None,
        fresh: bool = True,
    ) -> AsyncIterator[Fleet]:
        """A fleet that is ready; see the module for what that means."""
        if self.light:
            self.speedup = speedup or LIGHT_SPEEDUP
            async with SimulatedFleet(
                count=count,
                home_lonlat=home_lonlat,
                starts_lonlat=starts_lonlat,
                base_port=0,
                first_system_id=first_system_id,
                speedup=self.speedup,
                parameters={**survey_parameters(model), **(parameters or {})},
                kind=MODELS[model].vehicle,
            ) as light:
                yield light
            return
        program = PROGRAMS[MODELS[model].vehicle]
        if reason := why_not(program):
            pytest.skip(reason)
        self.speedup = speedup or max(1.0, min(10.0, BUDGET / count))
        fleet = ArdupilotFleet(
            count=count,
            home_lonlat=home_lonlat,
            starts_lonlat=starts_lonlat,
            model=model,
            base_port=0,
            first_system_id=first_system_id,
            speedup=self.speedup,
            parameters=parameters,
            folder=folder,
        )
        if fresh:
            self._pool.drop()
            async with fleet:
                yield fleet
            return
        yield await self._pool.take(fleet)

    async def sleep(self, seconds_s: float) -> None:
        """Sleep `seconds_s` on the water."""
        await asyncio.sleep(seconds_s / self.speedup)


class Pool:
    """The one ArduPilot fleet that is shared: an idle one costs as much as one at work."""

    def __init__(self) -> None:
        self._fleet: ArdupilotFleet | None = None
        self._what: object = None

    async def take(self, wanted: ArdupilotFleet) -> ArdupilotFleet:
        """Return a fleet like `wanted`, empty: the shared one, or `wanted` itself, started."""
        what = (wanted.model, wanted.starts_lonlat, wanted.system_ids, wanted.speedup)
        what = (*what, tuple(sorted(wanted.parameters.items())))
        shared = self._fleet
        if shared is not None and what == self._what and shared.alive:
            await shared.clear()
            return shared
        self.drop()
        await wanted.start()
        self._fleet, self._what = wanted, what
        return wanted

    def drop(self) -> None:
        fleet, self._fleet = self._fleet, None
        if fleet is not None:
            fleet.close()


@asynccontextmanager
async def ardupilot(count: int = 1, **options: object) -> AsyncIterator[ArdupilotFleet]:
    """An ArduPilot fleet for a test that has no light counterpart; takes Engine.fleet's options."""
    async with Engine("ardupilot", Pool()).fleet(count=count, **options) as fleet:  # type: ignore[arg-type]
        assert isinstance(fleet, ArdupilotFleet)
        yield fleet
