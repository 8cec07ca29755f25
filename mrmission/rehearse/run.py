"""A plan, a fleet of simulated vehicles started for it, and what they drove."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from mrmission.errors import ConfigError, SimulatorError, UploadError
from mrmission.model import Mission
from mrmission.rehearse.pilot import SailOrders, SailProgress, sail
from mrmission.rehearse.track import Track

if TYPE_CHECKING:
    from mrmission.vehicle.upload import UploadRow

ENGINES = ("light", "ardupilot")
FIRST_SYSTEM_ID = 1
MOST_SPEEDUP = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Waters:
    """The simulated fleet and the water that it sails on.

    Attributes
    ----------
    engine
        ``light`` or ``ardupilot``.
    model
        Of ArduPilot's models: ``motorboat`` steers, ``motorboat-skid`` pivots.
    speedup
        Seconds on the water per second on the wall.
    current_m_s, current_from_deg
        Speed of the current, and the compass bearing that it comes from. It begins to act when a
        mission starts, as a boat lies at a ramp until then.
    waves
        Whether there are waves.
    parameters
        More parameters, for all vehicles.
    base_port
        First TCP port; 0 takes free ones.
    """

    engine: str = "light"
    model: str = "motorboat"
    speedup: float = 10.0
    current_m_s: float = 0.0
    current_from_deg: float = 0.0
    waves: bool = False
    parameters: Mapping[str, float] = field(default_factory=dict)
    base_port: int = 0

    def __post_init__(self) -> None:
        if self.engine not in ENGINES:
            raise ConfigError(f"--engine {self.engine}: must be one of {', '.join(ENGINES)}")
        if not 0 < self.speedup <= MOST_SPEEDUP:
            raise ConfigError(f"--speedup {self.speedup:g}: must be above 0 and at most 100")
        if not 0 <= self.current_m_s <= 5:
            raise ConfigError(f"--current {self.current_m_s:g}: must be from 0 to 5 m/s")

    def across(self, lanes_deg: float) -> Waters:
        """Return the same with the current across lanes of a compass bearing, from their right."""
        return replace(self, current_from_deg=(lanes_deg + 90.0) % 360.0)

    def as_dict(self) -> dict[str, object]:
        """Return the settings as plain values, for the record."""
        return {
            "engine": self.engine,
            "model": self.model if self.engine == "ardupilot" else "light boat",
            "speedup": self.speedup,
            "current_m_s": self.current_m_s,
            "current_from_deg": self.current_from_deg,
            "waves": self.waves,
            "parameters": dict(sorted(self.parameters.items())),
        }

    def at_start(self) -> dict[str, float]:
        """Return the parameters that are set when a mission starts."""
        if self.current_m_s == 0:
            return {}
        return {"SIM_TIDE_DIR": self.current_from_deg % 360.0, "SIM_TIDE_SPEED": self.current_m_s}

    def from_boot(self) -> dict[str, float]:
        """Return the parameters that a vehicle boots with."""
        waves = {"SIM_WAVE_ENABLE": 1.0} if self.waves else {}
        return {**waves, **self.parameters}


def sailing_missions(missions: Sequence[Mission]) -> list[Mission]:
    """Return the missions that have somewhere to sail to, the first sortie of each robot."""
    return next(iter(sailing_rounds(missions)), [])


def sailing_rounds(missions: Sequence[Mission]) -> list[list[Mission]]:
    """Return the missions that have somewhere to sail to, those of each sortie together.

    A round has one mission of a robot at most; robots that go out less often miss the last ones.
    """
    sailing = [mission for mission in missions if len(mission.items) > 2]
    return [
        sorted((m for m in sailing if m.sortie == sortie), key=lambda m: m.robot)
        for sortie in sorted({m.sortie for m in sailing})
    ]


def home_of(mission: Mission) -> tuple[float, float]:
    """Return where a mission starts, (lon, lat) degrees."""
    home = mission.items[0]
    return home.y / 1e7, home.x / 1e7


def make_fleet(missions: Sequence[Mission], waters: Waters) -> Any:
    """Return a fleet, not started yet, whose vehicles lie at the homes of the missions."""
    starts = [home_of(mission) for mission in missions]
    if waters.engine == "ardupilot":
        from mrmission.simulate.ardupilot import ArdupilotFleet

        return ArdupilotFleet(
            count=len(missions),
            starts_lonlat=starts,
            model=waters.model,
            speedup=waters.speedup,
            parameters=waters.from_boot(),
            base_port=waters.base_port,
            first_system_id=FIRST_SYSTEM_ID,
        )
    from mrmission.simulate import SimulatedFleet
    from mrmission.simulate.ardupilot_models import survey_parameters

    return SimulatedFleet(
        count=len(missions),
        starts_lonlat=starts,
        speedup=waters.speedup,
        parameters={**survey_parameters(waters.model), **waters.from_boot()},
        base_port=waters.base_port,
        first_system_id=FIRST_SYSTEM_ID,
    )


async def sail_missions(
    missions: Sequence[Mission],
    waters: Waters,
    orders: SailOrders | None = None,
    *,
    stage: Callable[[str], None] = lambda _: None,
    progress: SailProgress | None = None,
) -> tuple[Track, ...]:
    """Start a fleet, upload the missions and verify them, sail them all, stop the fleet.

    Parameters
    ----------
    missions
        At most one per robot, none empty: a round of :func:`sailing_rounds`.
    waters
        The fleet and the water.
    orders
        How each mission is sailed; the current is added to it.
    stage, progress
        Called with what begins, and with every item that a vehicle turns to.

    Returns
    -------
    tuple of Track
        One per mission, in order.

    Raises
    ------
    ConfigError, SimulatorError
        When the fleet cannot be started, or a vehicle cannot be armed.
    UploadError
        When a mission was not verified.
    """
    from mrmission.vehicle.client import open_links
    from mrmission.vehicle.connection import parse_connections
    from mrmission.vehicle.links import LinkTimeouts
    from mrmission.vehicle.upload import upload_fleet

    orders = orders or SailOrders()
    orders = replace(orders, at_start={**orders.at_start, **waters.at_start()})
    stage(f"starting {len(missions)} vehicles")
    async with make_fleet(missions, waters) as fleet:
        given = dict(zip([m.robot for m in missions], fleet.system_ids, strict=True))
        stage("uploading")
        rows = await upload_fleet(missions, fleet.links, assignment=given)
        _check_upload(rows)
        stage("sailing")
        async with open_links(
            parse_connections(fleet.links), expected=len(missions), timeouts=LinkTimeouts(),
            patient=True,
        ) as links:  # fmt: skip
            missing = [number for number in fleet.system_ids if number not in links.vehicles]
            if missing:
                raise SimulatorError(f"vehicle {missing[0]} does not answer after the upload")
            watch = asyncio.create_task(fleet.run())
            voyages = asyncio.gather(
                *(
                    sail(links.vehicles[given[m.robot]], m, orders, progress=progress)
                    for m in missions
                )
            )
            try:
                await asyncio.wait({watch, voyages}, return_when=asyncio.FIRST_COMPLETED)
                if watch.done():
                    watch.result()
                tracks = await voyages
                return tuple(
                    replace(track, sortie=mission.sortie)
                    for track, mission in zip(tracks, missions, strict=True)
                )
            finally:
                watch.cancel()
                voyages.cancel()
                await asyncio.gather(watch, voyages, return_exceptions=True)


def _check_upload(rows: Sequence[UploadRow]) -> None:
    for row in rows:
        if not row.verified:
            raise UploadError(
                f"robot {row.robot}, vehicle {row.system_id}: {row.status}: {row.detail}"
            )
