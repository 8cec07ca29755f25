"""One ArduPilot SITL process: the program, its ports, its arguments, its end."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from mrmission.errors import ConfigError, SimulatorError

HOST = "127.0.0.1"
GUIDE_URL = "https://ardupilot.org/dev/docs/SITL-simulator-software-in-the-loop.html"
PROGRAMS = {"boat": "ardurover", "rover": "ardurover", "copter": "arducopter"}
LOG_NAME = "output.txt"
TAIL_LINES = 8
END_S = 2.0
"""ArduPilot ends within milliseconds of SIGTERM, or not at all."""
SECOND_LINK = 2
"""The second link is two ports above the first, as in ArduPilot's own numbering (5760, 5762)."""


def find_binary(vehicle: str, binary: str | os.PathLike[str] | None = None) -> Path:
    """Return the ArduPilot program that simulates a vehicle.

    Parameters
    ----------
    vehicle : str
        boat, rover or copter.
    binary : path, optional
        Where it is; else what the environment variable ``ARDUROVER`` (``ARDUCOPTER``) says,
        else ``PATH``.

    Raises
    ------
    SimulatorError
        When there is none, or it cannot be run.
    """
    program = PROGRAMS[vehicle]
    variable = program.upper()
    named = os.fspath(binary) if binary is not None else os.environ.get(variable)
    if named:
        where = "--binary" if binary is not None else variable
        found = shutil.which(named)
        if found is None:
            raise SimulatorError(f"{where} {named}: no such program, or it may not be run")
        return Path(found).resolve()
    found = shutil.which(program)
    if found is None:
        raise SimulatorError(
            f"no {program} found: it is not on PATH and {variable} names none. It is part of "
            f"ArduPilot; how to get it: {GUIDE_URL} . Without it: --engine light"
        )
    return Path(found).resolve()


def busy_ports(ports: Iterable[int]) -> list[int]:
    """Return those of `ports` on which something listens, or that may not be opened."""
    busy = []
    for port in ports:
        with socket.socket() as probe:
            # With it, as ArduPilot does: a port whose last connection has just ended is free.
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((HOST, port))
            except OSError:
                busy.append(port)
    return busy


def free_ports(count: int) -> tuple[int, ...]:
    """Return `count` different TCP ports nobody listens on."""
    with contextlib.ExitStack() as stack:
        probes = [stack.enter_context(socket.socket()) for _ in range(count)]
        for probe in probes:
            probe.bind((HOST, 0))
        return tuple(int(probe.getsockname()[1]) for probe in probes)


@dataclass(frozen=True, kw_only=True, slots=True)
class Launch:
    """What one process is started with.

    Parameters
    ----------
    binary : Path
        The program.
    model : str
        ArduPilot's name of the simulated hull or frame.
    system_id : int
        MAVLink system id; the instance number is one less, so that vehicles differ in their UID.
    port, second_port : int
        TCP ports of the two links. Each serves one client at a time.
    lon, lat : float
        Where it starts, degrees.
    altitude_m, heading_deg : float
        Above sea level; from north.
    speedup : float
        Simulated seconds per second.
    defaults : sequence of Path
        Parameter files; a later one wins.
    folder : Path
        Its own working directory: storage, logs, output.
    """

    binary: Path
    model: str
    system_id: int
    port: int
    second_port: int
    lon: float
    lat: float
    altitude_m: float
    heading_deg: float
    speedup: float
    defaults: Sequence[Path]
    folder: Path

    def arguments(self) -> list[str]:
        """Return the command line."""
        return [
            *_dies_with_parent(),
            str(self.binary),
            "--model",
            self.model,
            "-I",
            str(self.system_id - 1),
            "--sysid",
            str(self.system_id),
            "--home",
            f"{self.lat:.8f},{self.lon:.8f},{self.altitude_m:g},{self.heading_deg:g}",
            "--speedup",
            f"{self.speedup:g}",
            "--defaults",
            ",".join(str(path) for path in self.defaults),
            "--serial0",
            f"tcp:{self.port}",
            "--serial1",
            f"tcp:{self.second_port}",
            "--serial2",
            "none:",
            # RC input is UDP and shares its port with anybody; the number of a TCP port, which
            # nobody shares, keeps two fleets apart.
            "--rc-in-port",
            str(self.port),
        ]


def _dies_with_parent() -> list[str]:
    """Return a prefix that has the kernel kill the process when its parent dies, if there is one.

    ArduPilot itself looks every step whether its parent is still there, and ends; but a parent that
    nobody waits for stays in the process table, and a process that hangs does not look.
    """
    setpriv = shutil.which("setpriv")
    return [] if setpriv is None else [setpriv, "--pdeathsig", "KILL"]


class Process:
    """A started ArduPilot process.

    It has a session of its own, so that Ctrl-C reaches the fleet's owner alone, which then ends the
    vehicles in order.

    Parameters
    ----------
    launch : Launch
        What to start.
    """

    def __init__(self, launch: Launch) -> None:
        self.launch = launch
        launch.folder.mkdir(parents=True, exist_ok=True)
        with (launch.folder / LOG_NAME).open("ab") as log:
            try:
                self._popen = subprocess.Popen(
                    launch.arguments(),
                    cwd=launch.folder,
                    stdin=subprocess.DEVNULL,
                    stdout=log,
                    stderr=subprocess.STDOUT,
                    start_new_session=True,
                )
            except OSError as error:
                raise SimulatorError(
                    f"{launch.binary} cannot be started: {error.strerror or error}"
                ) from error

    @property
    def pid(self) -> int:
        """Process id, which is also the id of its group."""
        return self._popen.pid

    @property
    def alive(self) -> bool:
        """Whether it is still running."""
        return self._popen.poll() is None

    def ending(self) -> str:
        """Return how it ended and the last lines it wrote, as one line."""
        code = self._popen.poll()
        if code is None:
            how = "still running"
        elif code < 0:
            how = f"killed by {_signal_name(-code)}"
        else:
            how = f"ended with code {code}"
        lines = self.tail()
        return f"{how}; its last lines: {' | '.join(lines)}" if lines else f"{how}; it said nothing"

    def tail(self, lines: int = TAIL_LINES) -> list[str]:
        """Return the last lines of its output."""
        try:
            text = (self.launch.folder / LOG_NAME).read_text(errors="replace")
        except OSError:
            return []
        return [line.strip() for line in text.splitlines() if line.strip()][-lines:]

    def terminate(self) -> None:
        """Ask it to end."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """End it and what it started, at once, and wait until it is gone."""
        self._signal(signal.SIGKILL)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._popen.wait(END_S)

    def _signal(self, number: signal.Signals) -> None:
        # To the group, for what it started itself (a crash starts a stack trace); but not once the
        # process was waited for, when its id may belong to somebody else.
        if self._popen.returncode is None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._popen.pid, number)


def stop_all(processes: Sequence[Process], within_s: float = END_S) -> None:
    """End processes in order: ask all, wait together, kill those that do not listen."""
    for process in processes:
        process.terminate()
    deadline_s = time.monotonic() + within_s
    while any(process.alive for process in processes) and time.monotonic() < deadline_s:
        time.sleep(0.02)
    for process in processes:
        process.kill()


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def check_ports(ports: Sequence[int]) -> None:
    """Refuse ports that are out of range or taken.

    Raises
    ------
    ConfigError
        When a port does not exist.
    SimulatorError
        When something listens on one; all of them are named.
    """
    if not all(1024 <= port <= 65535 for port in ports):
        raise ConfigError(
            f"--base-port: the fleet would need ports {min(ports)} to {max(ports)}, "
            "there are 1024 to 65535"
        )
    busy = busy_ports(ports)
    if busy:
        raise SimulatorError(
            f"TCP port{'s' if len(busy) > 1 else ''} {', '.join(map(str, busy))} "
            f"{'are' if len(busy) > 1 else 'is'} taken; is another simulator running? "
            "Choose other ports with --base-port, 0 takes free ones; nothing was started"
        )
