"""A fleet of ArduPilot's own simulated vehicles (SITL), started, watched and stopped."""

from __future__ import annotations

import asyncio
import atexit
import contextlib
import math
import shutil
import tempfile
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from mrmission.errors import ConfigError, SimulatorError
from mrmission.simulate.ardupilot_models import (
    MODELS,
    check_base_port,
    parameter_file,
)
from mrmission.simulate.ardupilot_process import (
    HOST,
    SECOND_LINK,
    Launch,
    Process,
    check_ports,
    find_binary,
    free_ports,
    stop_all,
)
from mrmission.simulate.ardupilot_ready import (
    Readiness,
    check_parameters,
    empty_stores,
    wait_ready,
)
from mrmission.simulate.fleet import (
    BASE_PORT,
    BERTH_SPACING_M,
    PORT_STEP,
    check_numbers,
    checked_starts,
)
from mrmission.simulate.motion import moved

POLL_S = 0.2
READY_S = 150.0
"""Simulated seconds after which a vehicle that is not ready is given up; 42 is usual."""
SLOWEST = 0.2
"""Share of the speed-up that a busy machine must still reach before the wait is given up."""
LAUNCH_S = 20.0
"""Real seconds on top, for processes to come up on a busy machine."""
OWN_PARAMETERS = "extra.parm"
PORT_TRIES = 3
BIND_FAILED = "bind failed"
"""What ArduPilot writes when its port is taken."""


class ArdupilotFleet:
    """K ArduPilot processes on loopback, as an async context manager.

    On entering it starts them side by side, each in a folder of its own, and waits until every one
    can be armed and can start a mission (some 42 simulated seconds). On leaving, whatever the
    reason, none of them is left.

    Parameters
    ----------
    count : int
        Number of vehicles, 1 to 250.
    home_lonlat : tuple of float
        Where the first one lies; the others lie to its right.
    starts_lonlat : sequence of (lon, lat), optional
        A position for every vehicle, instead of `home_lonlat`.
    model : str
        A name of :data:`MODELS`.
    parameter_files : sequence of path, optional
        Instead of those of ``sitl/`` for the model.
    binary : path, optional
        The ArduPilot program; else ``ARDUROVER`` or ``ARDUCOPTER``, else ``PATH``.
    base_port : int
        Vehicle i (from 0) listens on TCP ports ``base_port + 10 i`` and two above; 0 takes free
        ports.
    first_system_id : int
        System id of the first vehicle; the others count up.
    speedup : float
        Simulated seconds per second. A machine that can't keep up is slower, nothing else.
    parameters : mapping of str to float, optional
        Values that differ from the parameter files, for all vehicles: ``SIM_TIDE_SPEED`` (m/s) and
        ``SIM_TIDE_DIR`` (where it comes from, degrees) make current, ``SIM_WAVE_ENABLE`` waves.
    heading_deg, spacing_m : float
        Where the bows point, and the distance between the berths.
    altitude_m : float
        Of the water above sea level.
    folder : Path, optional
        Keep every vehicle's folder there (storage, output, logs); else they are temporary.
    progress : callable, optional
        Called with a system id and a line whenever a vehicle comes a step nearer to being ready.

    Raises
    ------
    ConfigError
        When a number is out of range, or the vehicles do not know a parameter.
    SimulatorError
        When there is no program, a port is taken, a vehicle ends or does not get ready.

    Examples
    --------
    >>> async def rehearse() -> None:
    ...     async with ArdupilotFleet(
    ...         count=2, home_lonlat=(8.5, 47.3), base_port=0, speedup=5
    ...     ) as fleet:
    ...         print(fleet.links)
    """

    def __init__(
        self,
        *,
        count: int,
        home_lonlat: tuple[float, float] = (0.0, 0.0),
        starts_lonlat: Sequence[tuple[float, float]] | None = None,
        model: str = "motorboat",
        parameter_files: Sequence[Path] | None = None,
        binary: str | Path | None = None,
        base_port: int = BASE_PORT,
        first_system_id: int = 1,
        speedup: float = 1.0,
        parameters: Mapping[str, float] | None = None,
        heading_deg: float = 0.0,
        spacing_m: float = BERTH_SPACING_M,
        altitude_m: float = 1.0,
        folder: Path | None = None,
        progress: Callable[[int, str], None] | None = None,
    ) -> None:
        check_numbers(count, first_system_id, speedup, "vehicles")
        check_base_port(base_port, count)
        self.starts_lonlat = checked_starts(
            count, home_lonlat, starts_lonlat, spacing_m, heading_deg, "vehicles"
        )
        if model not in MODELS:
            raise ConfigError(f"--model {model}: must be one of {', '.join(MODELS)}")
        self.model = MODELS[model]
        self.speedup = speedup
        self.parameters = {name.upper(): float(value) for name, value in (parameters or {}).items()}
        self.system_ids = tuple(range(first_system_id, first_system_id + count))
        self.ports: tuple[int, ...] = ()
        self.second_ports: tuple[int, ...] = ()
        self.folders: tuple[Path, ...] = ()
        self.parameter_files = (
            tuple(parameter_file(name) for name in self.model.files)
            if parameter_files is None
            else tuple(Path(path).resolve() for path in parameter_files)
        )
        self._binary = binary
        self._base_port = base_port
        self._heading_deg = heading_deg
        self._altitude_m = altitude_m
        self._keep = folder
        self._root: Path | None = None
        self._progress = progress
        self._processes: list[Process] = []

    @property
    def links(self) -> list[str]:
        """Connection strings, one per vehicle; each serves one program at a time."""
        return [f"tcpout://{HOST}:{port}" for port in self.ports]

    @property
    def second_links(self) -> list[str]:
        """Connection strings for a second program at the same time, a ground station say."""
        return [f"tcpout://{HOST}:{port}" for port in self.second_ports]

    @property
    def pids(self) -> tuple[int, ...]:
        """Process ids, in the order of :attr:`links`."""
        return tuple(process.pid for process in self._processes)

    async def start(self) -> None:
        """Start every process and wait until all vehicles are ready; stop all if one is not."""
        if self._processes:
            raise SimulatorError("the fleet is already running")
        binary = find_binary(self.model.vehicle, self._binary)
        for attempt in range(1, PORT_TRIES + 1):
            try:
                await self._start(binary)
                return
            except SimulatorError as error:
                # A port that was free a moment ago: somebody else was given it meanwhile.
                lost = BIND_FAILED in str(error)
                if self._base_port or not lost or attempt == PORT_TRIES:
                    raise

    async def _start(self, binary: Path) -> None:
        count = len(self.system_ids)
        if self._base_port:
            self.ports = tuple(self._base_port + PORT_STEP * i for i in range(count))
            self.second_ports = tuple(port + SECOND_LINK for port in self.ports)
            check_ports(sorted((*self.ports, *self.second_ports)))
        else:
            ports = free_ports(2 * count)
            self.ports, self.second_ports = ports[:count], ports[count:]
        if self._keep is not None:
            self._keep.mkdir(parents=True, exist_ok=True)
            self._root = self._keep.resolve()
        else:
            self._root = Path(tempfile.mkdtemp(prefix="mrmission-sitl-"))
        self.folders = tuple(self._root / f"vehicle-{number}" for number in self.system_ids)
        atexit.register(self._end)
        try:
            own = self._own_parameters(self._root)
            for index in range(count):
                self._processes.append(
                    Process(self._launch(index, binary, [*self.parameter_files, own]))
                )
            await self.wait_ready()
            await self._watched(
                check_parameters(port, number, self.parameters)
                for port, number in zip(self.second_ports, self.system_ids, strict=True)
            )
        except BaseException:
            self._end()
            raise

    async def wait_ready(self) -> None:
        """Wait until every vehicle can be armed and started; also after a reboot.

        Raises
        ------
        SimulatorError
            When one ends, or is not ready in time.
        """
        states = [Readiness() for _ in self.system_ids]
        limit_s = LAUNCH_S + READY_S / (self.speedup * SLOWEST)
        hold = self.model.vehicle != "copter"
        try:
            async with asyncio.timeout(limit_s):
                await self._watched(
                    wait_ready(
                        port, number, hold=hold, state=state, progress=self._reporter(number)
                    )
                    for port, number, state in zip(
                        self.second_ports, self.system_ids, states, strict=True
                    )
                )
        except TimeoutError:
            wanted = 4 if hold else None
            late = [
                f"vehicle {number}: {state.step(wanted)}{state.reason and f' ({state.reason})'}"
                for number, state in zip(self.system_ids, states, strict=True)
                if state.step(wanted) != "ready"
            ]
            raise SimulatorError(
                f"not ready after {limit_s:.0f} s: {'; '.join(late)}; is the machine too busy for "
                f"--speedup {self.speedup:g}?"
            ) from None

    async def run(self) -> None:
        """Wait as long as all vehicles run.

        Raises
        ------
        SimulatorError
            When one ends by itself, with the last lines it wrote. It is not started again.
        """
        while self._processes:
            for process in self._processes:
                if not process.alive:
                    raise SimulatorError(self._crash(process))
            await asyncio.sleep(POLL_S)

    async def stop(self) -> None:
        """End every process and remove the temporary folders."""
        self._end()

    def close(self) -> None:
        """Do as :meth:`stop` does, for callers without an event loop."""
        self._end()

    @property
    def alive(self) -> bool:
        """Whether the fleet was started and all of its processes run."""
        return bool(self._processes) and all(process.alive for process in self._processes)

    async def clear(self) -> None:
        """Disarm every vehicle and empty its mission, fence and rally points; it stays where it is.

        Raises
        ------
        SimulatorError
            When one ends, or does not do it.
        """
        hold = self.model.vehicle != "copter"
        await self._watched(
            empty_stores(port, number, hold=hold)
            for port, number in zip(self.second_ports, self.system_ids, strict=True)
        )

    async def restart(self) -> None:
        """Start afresh: empty stores, parameters as given, at the berths, ready; the same ports."""
        ports = self.ports, self.second_ports
        stop_all(self._processes)
        old, self._processes = self._processes, []
        for process in old:
            with contextlib.suppress(OSError):
                shutil.rmtree(process.launch.folder)
        self.ports, self.second_ports = ports
        try:
            for process in old:
                self._processes.append(Process(process.launch))
            await self.wait_ready()
        except BaseException:
            self._end()
            raise

    def _launch(self, index: int, binary: Path, defaults: Sequence[Path]) -> Launch:
        lon, lat = self.starts_lonlat[index]
        ahead_rad = math.radians(self._heading_deg)
        lat, lon = moved(
            lat,
            lon,
            self.model.astern_m * math.sin(ahead_rad),
            self.model.astern_m * math.cos(ahead_rad),
        )
        return Launch(
            binary=binary,
            model=self.model.frame,
            system_id=self.system_ids[index],
            port=self.ports[index],
            second_port=self.second_ports[index],
            lon=lon,
            lat=lat,
            altitude_m=self._altitude_m,
            heading_deg=self._heading_deg,
            speedup=self.speedup,
            defaults=tuple(defaults),
            folder=self.folders[index],
        )

    def _own_parameters(self, root: Path) -> Path:
        """Write the parameters of this fleet as a file that is read last."""
        values = dict(self.parameters)
        if self._keep is not None:
            # Who keeps the folders wants the logs in them.
            values.setdefault("LOG_BACKEND_TYPE", 1.0)
        path = root / OWN_PARAMETERS
        path.write_text("".join(f"{name} {value!r}\n" for name, value in values.items()))
        return path

    def _reporter(self, number: int) -> Callable[[str], None] | None:
        progress = self._progress
        if progress is None:
            return None
        return lambda line: progress(number, line)

    async def _watched(self, work: Iterable[Coroutine[Any, Any, None]]) -> None:
        """Run one coroutine per vehicle, and stop at once when a process ends."""
        tasks = [asyncio.create_task(one) for one in work]
        watch = asyncio.create_task(self.run())
        try:
            pending: set[asyncio.Task[None]] = set(tasks)
            while pending and not watch.done():
                done, pending = await asyncio.wait(
                    {watch, *pending}, return_when=asyncio.FIRST_COMPLETED
                )
                pending.discard(watch)
                if any(task.exception() for task in done - {watch}):
                    break
            if watch.done():
                watch.result()
            for task in tasks:
                error = task.exception() if task.done() else None
                if isinstance(error, ConnectionError):
                    # The process is going: let the watch say why.
                    await asyncio.wait({watch}, timeout=5 * POLL_S)
                    if watch.done():
                        watch.result()
                    raise SimulatorError(f"a vehicle's link broke: {error}") from error
                if error is not None:
                    raise error
        finally:
            for task in (*tasks, watch):
                task.cancel()
            await asyncio.gather(*tasks, watch, return_exceptions=True)

    def _crash(self, process: Process) -> str:
        launch = process.launch
        kept = (
            f"its folder: {launch.folder}"
            if self._keep is not None
            else "its folder was temporary, --keep keeps it"
        )
        return (
            f"vehicle {launch.system_id} ({launch.binary.name} on TCP port {launch.port}) "
            f"{process.ending()}; {kept}"
        )

    def _end(self) -> None:
        """End all, leave nothing; may be called at any time and more than once."""
        processes, self._processes = self._processes, []
        stop_all(processes)
        root, self._root = self._root, None
        if root is not None and self._keep is None:
            shutil.rmtree(root, ignore_errors=True)
        atexit.unregister(self._end)

    async def __aenter__(self) -> ArdupilotFleet:
        await self.start()
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.stop()
