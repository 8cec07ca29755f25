"""A fleet of simulated boats in one process, each with its own system id and TCP port."""

from __future__ import annotations

import asyncio
import contextlib
import math
import threading
from collections.abc import Mapping, Sequence
from types import TracebackType

from mrmission.errors import ConfigError, SimulatorError
from mrmission.simulate.motion import Kinematics, moved
from mrmission.simulate.transport import Faults, VehicleServer
from mrmission.simulate.vehicle import SimVehicle, VehicleSetup

TICK_S = 0.05
PORT_STEP = 10
"""ArduPilot's SITL instance i listens on 5760 + 10 i."""
BASE_PORT = 5760
BERTH_SPACING_M = 15.0
HOST = "127.0.0.1"


def berths_lonlat(
    home_lonlat: tuple[float, float],
    count: int,
    spacing_m: float = BERTH_SPACING_M,
    heading_deg: float = 0.0,
) -> tuple[tuple[float, float], ...]:
    """Return `count` positions side by side, the first at home, the others to its right.

    Parameters
    ----------
    home_lonlat : tuple of float
        Longitude and latitude of the first berth, degrees.
    count : int
        Number of berths.
    spacing_m : float
        Distance between neighbours.
    heading_deg : float
        Where the boats' bows point.

    Returns
    -------
    tuple of (lon, lat)
    """
    lon, lat = home_lonlat
    right = math.radians(heading_deg + 90.0)
    points = (
        moved(lat, lon, i * spacing_m * math.sin(right), i * spacing_m * math.cos(right))
        for i in range(count)
    )
    return tuple((round(point[1], 7), round(point[0], 7)) for point in points)


def check_numbers(count: int, first_system_id: int, speedup: float, noun: str) -> None:
    """Refuse numbers that no fleet can have; `noun` is what its vehicles are called.

    Raises
    ------
    ConfigError
        When a number is out of range.
    """
    if not 1 <= count <= 250:
        raise ConfigError(f"--k {count}: a simulated fleet has 1 to 250 {noun}")
    last_id = first_system_id + count - 1
    if not (first_system_id >= 1 and last_id <= 255):
        raise ConfigError(
            f"--sysid {first_system_id}: {count} {noun} need system ids up to {last_id}, "
            "MAVLink has 1 to 255"
        )
    if not (math.isfinite(speedup) and 0 < speedup <= 100):
        raise ConfigError(f"--speedup {speedup}: must be above 0 and at most 100")


def checked_starts(
    count: int,
    home_lonlat: tuple[float, float],
    starts_lonlat: Sequence[tuple[float, float]] | None,
    spacing_m: float,
    heading_deg: float,
    noun: str,
) -> tuple[tuple[float, float], ...]:
    """Return where every vehicle starts.

    Raises
    ------
    ConfigError
        When the positions are not as many as vehicles, or one is no lon/lat.
    """
    starts = (
        tuple(starts_lonlat)
        if starts_lonlat is not None
        else berths_lonlat(home_lonlat, count, spacing_m, heading_deg)
    )
    if len(starts) != count:
        raise ConfigError(f"{len(starts)} start positions given for {count} {noun}")
    for lon, lat in starts:
        if not (abs(lon) <= 180 and abs(lat) < 90):
            raise ConfigError(f"--home {lon},{lat}: must be LON,LAT in degrees")
    return starts


class SimulatedFleet:
    """K simulated boats on loopback, as an async context manager.

    Parameters
    ----------
    count : int
        Number of boats, 1 to 250.
    home_lonlat : tuple of float
        Where the first boat lies; the others lie beside it.
    starts_lonlat : sequence of (lon, lat), optional
        A position for every boat, instead of `home_lonlat`.
    base_port : int
        Boat i (from 0) listens on TCP port ``base_port + 10 i``; 0 takes free ports.
    first_system_id : int
        System id of the first boat; the others count up.
    speedup : float
        Seconds on the water per second of real time.
    parameters : mapping of str to float, optional
        Parameter values that differ from ArduPilot's defaults, for all boats.
    ready_s : float
        Time on the water until a boat can be armed.
    heading_deg, spacing_m : float
        Where the bows point, and the distance between the berths.
    faults : Faults, optional
        Loss, duplication and reordering on every link.
    udp_out : tuple of (host, port), optional
        Send to a ground station that listens there, instead of opening TCP servers.
    kinematics : Kinematics, optional
        How the boats move.
    kind : str
        "boat", "rover" or "copter".

    Raises
    ------
    ConfigError
        When a number is out of range.
    SimulatorError
        On entering, when a port is taken.

    Examples
    --------
    >>> async def rehearse() -> None:
    ...     async with SimulatedFleet(count=2, home_lonlat=(8.5, 47.3), base_port=0) as fleet:
    ...         print(fleet.links)
    """

    def __init__(
        self,
        *,
        count: int,
        home_lonlat: tuple[float, float] = (0.0, 0.0),
        starts_lonlat: Sequence[tuple[float, float]] | None = None,
        base_port: int = BASE_PORT,
        first_system_id: int = 1,
        speedup: float = 1.0,
        parameters: Mapping[str, float] | None = None,
        ready_s: float = 0.0,
        heading_deg: float = 0.0,
        spacing_m: float = BERTH_SPACING_M,
        faults: Faults | None = None,
        udp_out: tuple[str, int] | None = None,
        kinematics: Kinematics | None = None,
        kind: str = "boat",
    ) -> None:
        check_numbers(count, first_system_id, speedup, "boats")
        last_port = base_port + PORT_STEP * (count - 1)
        if base_port != 0 and not (base_port >= 1 and last_port <= 65535):
            raise ConfigError(
                f"--base-port {base_port}: {count} boats need ports up to {last_port}, "
                "the last there is is 65535"
            )
        starts = checked_starts(count, home_lonlat, starts_lonlat, spacing_m, heading_deg, "boats")
        self._base_port = base_port
        self._udp_out = udp_out
        self.starts_lonlat = starts
        self.vehicles = tuple(
            SimVehicle(
                VehicleSetup(
                    kind=kind,
                    system_id=first_system_id + i,
                    lon=lon,
                    lat=lat,
                    heading_deg=heading_deg,
                    speedup=speedup,
                    parameters=dict(parameters or {}),
                    ready_s=ready_s,
                    kinematics=kinematics or Kinematics(),
                )
            )
            for i, (lon, lat) in enumerate(starts)
        )
        self._servers = tuple(VehicleServer(vehicle, faults) for vehicle in self.vehicles)
        self._ticker: asyncio.Task[None] | None = None
        self.ports: tuple[int, ...] = ()

    @property
    def system_ids(self) -> tuple[int, ...]:
        """System ids of the boats, in the order of :attr:`links`."""
        return tuple(vehicle.system_id for vehicle in self.vehicles)

    @property
    def links(self) -> list[str]:
        """Connection strings for MAVSDK: one per boat, or the one of `udp_out`."""
        if self._udp_out is not None:
            return [f"udpin://0.0.0.0:{self._udp_out[1]}"]
        return [f"tcpout://{HOST}:{port}" for port in self.ports]

    async def start(self) -> None:
        """Open the ports and set the boats afloat."""
        ports: list[int] = []
        try:
            for index, server in enumerate(self._servers):
                if self._udp_out is not None:
                    await server.send_to(*self._udp_out)
                    continue
                wanted = self._base_port + PORT_STEP * index if self._base_port else 0
                try:
                    ports.append(await server.listen(HOST, wanted))
                except OSError as error:
                    raise SimulatorError(
                        f"simulated boat {index + 1}: TCP port {wanted} cannot be opened "
                        f"({error.strerror or error}); is another simulator running? "
                        "Choose other ports with --base-port"
                    ) from error
        except BaseException:
            self._close()
            raise
        self.ports = tuple(ports)
        self._ticker = asyncio.create_task(self._tick())

    async def run(self) -> None:
        """Wait until the fleet is stopped; an error inside a boat is raised here."""
        if self._ticker is not None:
            await asyncio.shield(self._ticker)

    async def stop(self) -> None:
        """Take the boats off the water and close the ports."""
        ticker, self._ticker = self._ticker, None
        self._close()
        if ticker is not None:
            ticker.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await ticker
        # One turn of the loop lets aborted connections finish closing.
        await asyncio.sleep(0)

    def _close(self) -> None:
        for server in self._servers:
            server.close()

    async def _tick(self) -> None:
        loop = asyncio.get_running_loop()
        start_s = loop.time()
        while True:
            now_s = loop.time() - start_s
            for server in self._servers:
                server.tick(now_s)
            spent_s = loop.time() - start_s - now_s
            await asyncio.sleep(max(0.001, TICK_S - spent_s))

    async def __aenter__(self) -> SimulatedFleet:
        await self.start()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.stop()


class FleetThread:
    """A :class:`SimulatedFleet` in a thread of its own, as an ordinary context manager.

    For callers without an event loop, and for those whose event loop is busy: the boats go on
    answering while the caller computes.

    Parameters
    ----------
    fleet : SimulatedFleet
        Not started yet.
    """

    def __init__(self, fleet: SimulatedFleet) -> None:
        self.fleet = fleet
        self._thread: threading.Thread | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ready = threading.Event()
        self._quit: asyncio.Event | None = None
        self._error: BaseException | None = None

    def __enter__(self) -> SimulatedFleet:
        self._thread = threading.Thread(target=self._main, name="simulated-fleet", daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._error is not None:
            self._thread.join()
            raise self._error
        return self.fleet

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._loop is not None and self._quit is not None and self._loop.is_running():
            self._loop.call_soon_threadsafe(self._quit.set)
        if self._thread is not None:
            self._thread.join()
        if self._error is not None and error is None:
            raise self._error

    def _main(self) -> None:
        try:
            asyncio.run(self._serve())
        except BaseException as error:
            self._error = error
        finally:
            self._ready.set()

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._quit = asyncio.Event()
        async with self.fleet:
            self._ready.set()
            quitting = asyncio.ensure_future(self._quit.wait())
            running = asyncio.ensure_future(self.fleet.run())
            done, _ = await asyncio.wait({quitting, running}, return_when=asyncio.FIRST_COMPLETED)
            for task in (quitting, running):
                task.cancel()
            if running in done:
                running.result()
