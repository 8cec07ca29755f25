"""The launcher of ArduPilot fleets, with a program that only behaves like one, well or badly."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner

from mrmission.cli.homes import plan_homes
from mrmission.cli.main import cli
from mrmission.errors import ConfigError, InputError, SimulatorError
from mrmission.mission.qgc_plan import write_plan
from mrmission.model import Mission
from mrmission.simulate import ArdupilotFleet
from mrmission.simulate.ardupilot_models import (
    MODELS,
    parameter_file,
    read_parameters,
    survey_parameters,
)
from mrmission.simulate.ardupilot_process import find_binary, free_ports
from mrmission.simulate.motion import offset_m
from mrmission.simulate.wire import Codec, mavlink

HOME = (8.5, 47.3)
FAKE = """\
import os, signal, socket, sys, time
words = sys.argv[1:]
word = lambda name: words[words.index(name) + 1]
number, manner = word("--sysid"), os.environ.get("FAKE", "ready")
folder = os.path.dirname(os.path.abspath(__file__))
if ":" in manner:
    manner, _, who = manner.partition(":")
    manner = manner if who == number else "ready"
if manner == "deaf":
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
print("Starting sketch 'Rover'", flush=True)
print(" ".join(words), flush=True)
servers = []
for name in ("--serial0", "--serial1"):
    server = socket.socket()
    server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        server.bind(("127.0.0.1", int(word(name).partition(":")[2])))
    except OSError as error:
        print("bind failed on port", word(name), error, flush=True)
        sys.exit(1)
    server.listen()
    servers.append(server)
frames = open(os.path.join(folder, f"frames-{number}"), "rb").read()
if manner == "silent":
    frames = b""
started = time.monotonic()
while True:
    servers[1].settimeout(0.1)
    if manner == "dies" and time.monotonic() - started > 0.5:
        print("panic: the hull broke", flush=True)
        sys.exit(3)
    try:
        client, _ = servers[1].accept()
    except TimeoutError:
        continue
    try:
        while True:
            if manner == "crash":
                print("Floating point exception - aborting", flush=True)
                os.abort()
            client.sendall(frames)
            time.sleep(0.05)
    except OSError:
        pass
"""


def frames(number: int) -> bytes:
    """What a ready Rover sends, and one parameter."""
    codec = Codec(number)
    position = mavlink.EKF_POS_HORIZ_ABS
    checks = mavlink.MAV_SYS_STATUS_PREARM_CHECK
    return b"".join(
        codec.encode(message)
        for message in (
            mavlink.MAVLink_heartbeat_message(11, 3, 1, 4, 3, 3),
            mavlink.MAVLink_gps_raw_int_message(0, 6, 0, 0, 0, 0, 0, 0, 0, 9),
            mavlink.MAVLink_sys_status_message(
                checks, checks, checks, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0
            ),
            mavlink.MAVLink_ekf_status_report_message(position, 0, 0, 0, 0, 0),
            mavlink.MAVLink_param_value_message(b"WP_SPEED", 3.0, 9, 1, 0),
        )
    )


@pytest.fixture
def fake(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """A program on PATH in place of ardurover, with the manners that are asked for."""
    folder = tmp_path / "bin"
    folder.mkdir()
    program = folder / "ardurover"
    program.write_text(f"#!{sys.executable} -SE\n{FAKE}")
    program.chmod(0o755)
    for number in range(1, 5):
        (folder / f"frames-{number}").write_bytes(frames(number))
    monkeypatch.delenv("ARDUROVER", raising=False)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")

    def behave(manner: str = "ready") -> Path:
        monkeypatch.setenv("FAKE", manner)
        return program

    return behave


def gone(pid: int, within_s: float = 5.0) -> bool:
    """Whether a process has ended; one that nobody waits for counts as ended."""
    deadline_s = time.monotonic() + within_s
    while time.monotonic() < deadline_s:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            return True
        if state in "ZX":
            return True
        time.sleep(0.02)
    return False


def fleet(count: int = 2, **options: object) -> ArdupilotFleet:
    options = {"home_lonlat": HOME, "base_port": 0, "speedup": 50.0, **options}
    return ArdupilotFleet(count=count, **options)  # type: ignore[arg-type]


async def test_a_fleet_starts_side_by_side_and_leaves_nothing(
    fake: Callable[..., Path], tmp_path: Path
) -> None:
    fake()
    steps: list[tuple[int, str]] = []
    async with fleet(
        3, parameters={"wp_speed": 3}, progress=lambda n, step: steps.append((n, step))
    ) as afloat:
        assert afloat.system_ids == (1, 2, 3)
        assert len(set(afloat.ports + afloat.second_ports)) == 6
        assert sorted(n for n, step in steps if step == "ready") == [1, 2, 3]
        pids, folders = afloat.pids, afloat.folders
        starts = []
        for folder in folders:
            words = (folder / "output.txt").read_text().splitlines()[1].split()
            lat, lon, altitude, heading = map(float, words[words.index("--home") + 1].split(","))
            assert (altitude, heading) == (1.0, 0.0)
            starts.append(offset_m(HOME[1], HOME[0], lat, lon))
            assert words[words.index("--serial2") + 1] == "none:"
        # 15 m from boat to boat, and ahead by what SITL's boats go astern before they are ready
        assert [round(east) for east, _ in starts] == [0, 15, 30]
        assert {round(north) for _, north in starts} == {round(MODELS["motorboat"].astern_m)}
        assert afloat.alive
    assert not afloat.alive
    assert all(gone(pid) for pid in pids)
    assert not any(folder.exists() for folder in folders)
    assert not folders[0].parent.exists()


async def test_a_kept_folder_is_kept(fake: Callable[..., Path], tmp_path: Path) -> None:
    fake()
    async with fleet(1, folder=tmp_path / "kept"):
        pass
    assert "Rover" in (tmp_path / "kept" / "vehicle-1" / "output.txt").read_text()
    assert read_parameters(tmp_path / "kept" / "extra.parm") == {"LOG_BACKEND_TYPE": 1.0}


async def test_a_crash_before_it_is_ready_ends_all_and_says_why(fake: Callable[..., Path]) -> None:
    fake("crash:2")
    afloat = fleet(2)
    with pytest.raises(
        SimulatorError, match=r"vehicle 2 .* killed by SIGABRT.*Floating point exception"
    ):
        await afloat.start()
    assert afloat.pids == ()
    assert not afloat.folders[0].exists()


async def test_a_crash_later_is_raised_by_run(fake: Callable[..., Path]) -> None:
    fake("dies:1")
    async with fleet(2) as afloat:
        pids = afloat.pids
        with pytest.raises(SimulatorError, match=r"vehicle 1 .*code 3.*the hull broke.*--keep"):
            await asyncio.wait_for(afloat.run(), 10.0)
    assert all(gone(pid) for pid in pids)


async def test_a_vehicle_that_does_not_listen_is_killed(fake: Callable[..., Path]) -> None:
    fake("deaf")
    async with fleet(2) as afloat:
        pids = afloat.pids
    assert all(gone(pid, 0.1) for pid in pids)


async def test_a_vehicle_that_never_gets_ready_is_named(
    fake: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    fake("silent:2")
    monkeypatch.setattr("mrmission.simulate.ardupilot.LAUNCH_S", 1.0)
    monkeypatch.setattr("mrmission.simulate.ardupilot.READY_S", 1.0)
    with pytest.raises(SimulatorError, match=r"vehicle 2: no heartbeat; .*--speedup 50$|too busy"):
        await fleet(2).start()


async def test_an_exception_and_a_cancellation_leave_nothing(fake: Callable[..., Path]) -> None:
    fake()
    afloat = fleet(1)
    pids: tuple[int, ...] = ()

    async def fail() -> None:
        nonlocal pids
        async with afloat:
            pids = afloat.pids
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail()
    assert gone(pids[0])
    fake("silent")
    waiting = asyncio.create_task(afloat.start())
    while not afloat.pids:
        await asyncio.sleep(0.02)
    pids = afloat.pids
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting
    assert gone(pids[0])


async def test_taken_ports_are_named_before_anything_starts(
    fake: Callable[..., Path], tmp_path: Path
) -> None:
    fake()
    base = free_ports(1)[0]
    with socket.socket() as other:
        other.bind(("127.0.0.1", base))
        other.listen()
        with pytest.raises(SimulatorError, match=rf"TCP port {base} is taken.*nothing was started"):
            await fleet(2, base_port=base, folder=tmp_path / "kept").start()
    assert not (tmp_path / "kept").exists()
    async with fleet(2, base_port=base):
        with pytest.raises(SimulatorError, match=rf"ports {base}, {base + 2}, {base + 10}.*taken"):
            await fleet(2, base_port=base).start()


async def test_a_parameter_that_the_vehicle_has_not_or_not_so(
    fake: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    fake()
    with pytest.raises(ConfigError, match="WP_SPEED=4: the vehicle has 3 instead"):
        await fleet(1, parameters={"WP_SPEED": 4}).start()
    monkeypatch.setattr(
        "mrmission.simulate.ardupilot.check_parameters.__defaults__", (0.5,), raising=False
    )
    with pytest.raises(ConfigError, match=r"--param WP_SPED: .* no such parameter"):
        await fleet(1, parameters={"WP_SPED": 4}).start()


def test_without_a_program_the_message_says_where_to_get_one(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("ARDUROVER", raising=False)
    result = CliRunner().invoke(cli, ["sim", "--engine", "ardupilot", "--home", "8.5,47.3"])
    assert isinstance(result.exception, SimulatorError)
    assert result.exception.exit_code == 5
    assert "no ardurover found" in str(result.exception)
    assert "https://ardupilot.org/" in str(result.exception)
    monkeypatch.setenv("ARDUROVER", str(tmp_path / "nowhere"))
    with pytest.raises(SimulatorError, match=r"ARDUROVER .*nowhere: no such program"):
        find_binary("boat")
    with pytest.raises(SimulatorError, match=r"--binary .*tmp.*: no such program"):
        find_binary("boat", "/tmp")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--k", "0"], "--k 0"),
        (["--engine", "ardupilot", "--k", "251"], "--k 251"),
        (["--engine", "ardupilot", "--loss", "0.1"], "--loss"),
        (["--keep", "there"], "--keep"),
        (["--model", "motorboat-skid"], "light engine"),
        (["--model", "quad", "--vehicle", "boat"], "that is a copter"),
        (["--engine", "ardupilot", "--model", "submarine"], "motorboat-skid"),
        (["--engine", "ardupilot", "--base-port", "100"], "--base-port 100"),
        (["--engine", "ardupilot", "--base-port", "65534"], "65536"),
        (["--engine", "ardupilot", "--speedup", "0"], "--speedup"),
        (["--engine", "ardupilot", "--sysid", "255", "--k", "2"], "--sysid"),
        (["--for", ".", "--home", "1,2"], "choose one"),
    ],
)
def test_bad_options(arguments: list[str], said: str) -> None:
    result = CliRunner().invoke(cli, ["sim", *arguments])
    assert isinstance(result.exception, ConfigError), result.output
    assert said in str(result.exception)
    # nothing was assumed for a command that cannot run
    assert "assumed" not in result.output


def command(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "mrmission", "sim", "--engine", "ardupilot", *arguments],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[str]]]:
    processes: list[subprocess.Popen[str]] = []
    yield processes
    for process in processes:
        process.kill()
        process.communicate()


def children(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(word) for word in text.split()]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_command_ends_its_boats(
    fake: Callable[..., Path], started: list[subprocess.Popen[str]], number: signal.Signals
) -> None:
    fake("deaf:2")
    process = command("--k", "2", "--base-port", "0", "--home", "8.5,47.3", "--json")
    started.append(process)
    assert process.stdout is not None
    boats = json.loads(process.stdout.readline())["boats"]
    assert [boat["system_id"] for boat in boats] == [1, 2]
    assert boats[0]["link"] != boats[0]["second_link"]
    pids = children(process.pid)
    assert len(pids) == 2
    process.send_signal(number)
    _, errors = process.communicate(timeout=15)
    assert process.returncode == 0, errors
    assert "vehicle   2  ready" in errors
    assert "afloat" in errors
    assert all(gone(pid, 0.5) for pid in pids)


def test_ctrl_c_while_they_get_ready(
    fake: Callable[..., Path], started: list[subprocess.Popen[str]]
) -> None:
    fake("silent")
    process = command("--k", "2", "--base-port", "0", "--home", "8.5,47.3")
    started.append(process)
    deadline_s = time.monotonic() + 20.0
    while len(pids := children(process.pid)) < 2 and time.monotonic() < deadline_s:
        time.sleep(0.05)
    assert len(pids) == 2
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=15)
    assert "Traceback" not in errors
    assert process.returncode == 0, errors
    assert all(gone(pid, 0.5) for pid in pids)


@pytest.mark.skipif(sys.platform != "linux", reason="prctl is Linux's")
def test_boats_do_not_outlive_a_killed_parent(
    fake: Callable[..., Path], started: list[subprocess.Popen[str]]
) -> None:
    fake("deaf")
    process = command("--k", "2", "--base-port", "0", "--home", "8.5,47.3", "--json")
    started.append(process)
    assert process.stdout is not None
    process.stdout.readline()
    pids = children(process.pid)
    process.kill()
    assert len(pids) == 2
    assert all(gone(pid) for pid in pids)


# --- what they are started with ---


def test_every_model_has_its_files_and_says_why() -> None:
    for model in MODELS.values():
        for name in model.files:
            path = parameter_file(name)
            assert read_parameters(path)
            assert path.read_text().startswith("#")
    assert survey_parameters("motorboat")["FRAME_CLASS"] == 2
    assert survey_parameters("motorboat-skid")["SERVO1_FUNCTION"] == 73
    assert survey_parameters("motorboat")["INITIAL_MODE"] == 4


@pytest.mark.parametrize("line", ["WP_SPEED", "WP_SPEED fast", "WP_SPEED 1 2", "WP_SPEED nan"])
def test_bad_parameter_files(tmp_path: Path, line: str) -> None:
    path = tmp_path / "bad.parm"
    path.write_text(f"# fine\nWP_RADIUS,2 # m\nwp_accel=1\n{line}\n")
    with pytest.raises(ConfigError, match=r"bad\.parm, line 4"):
        read_parameters(path)
    with pytest.raises(ConfigError, match=r"none\.parm"):
        read_parameters(tmp_path / "none.parm")


def test_the_homes_of_plans(tmp_path: Path) -> None:
    homes = [(8.5, 47.3), (8.5, 47.3), (8.6, 47.3)]
    for robot, home in enumerate(homes, start=1):
        empty = Mission(robot=robot, sortie=1, vehicle="boat", items=(), fence=(), rally=())
        write_plan(empty, tmp_path / f"robot-{robot}.plan", home_lonlat=home)
    write_plan(empty, tmp_path / "robot-3-sortie-2.plan", home_lonlat=(1.0, 2.0))
    got = plan_homes(tmp_path)
    assert got[0] == homes[0]
    assert got[2] == homes[2]
    # the second can't lie on the first: it lies beside it
    assert [round(x) for x in offset_m(47.3, 8.5, got[1][1], got[1][0])] == [15, 0]
    with pytest.raises(ConfigError, match=r"--k 2: .* 3 robots"):
        cli.main(["sim", "--for", str(tmp_path), "--k", "2"], standalone_mode=False)
    with pytest.raises(InputError, match="no robot-1"):
        plan_homes(tmp_path.parent)
    with pytest.raises(InputError, match="not a folder"):
        plan_homes(tmp_path / "none")


SCRIPT = Path(__file__).resolve().parents[2] / "sitl" / "fleet.sh"


def test_the_script_without_python_starts_and_ends_the_same_boats(
    fake: Callable[..., Path], started: list[subprocess.Popen[str]], tmp_path: Path
) -> None:
    fake()
    port = free_ports(1)[0]
    settings = {"K": "2", "BERTH": "8.5,47.3", "PORT": str(port), "TMPDIR": str(tmp_path)}
    process = subprocess.Popen(
        [str(SCRIPT)], env={**os.environ, **settings},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    started.append(process)
    assert process.stdout is not None
    assert [process.stdout.readline()[:6] for _ in range(3)] == ["boat 1", "boat 2", "boats "]
    logs = [next(tmp_path.glob("tmp.*")) / str(i) / "output.txt" for i in (0, 1)]
    deadline_s = time.monotonic() + 10.0
    while time.monotonic() < deadline_s and not all(
        log.read_text().count("\n") >= 2 for log in logs
    ):
        time.sleep(0.05)
    for index, log in enumerate(logs):
        words = log.read_text().splitlines()[1].split()
        word = {words[i]: words[i + 1] for i in range(0, len(words), 2)}
        assert (word["--sysid"], word["-I"]) == (str(index + 1), str(index))
        assert word["--serial1"] == f"tcp:{port + 10 * index + 2}"
        assert [Path(path).name for path in word["--defaults"].split(",")] == [
            *MODELS["motorboat"].files
        ]
        lat, lon, *_ = map(float, word["--home"].split(","))
        east_m, north_m = offset_m(HOME[1], HOME[0], lat, lon)
        assert east_m == pytest.approx(15.0 * index, abs=0.02)
        assert north_m == pytest.approx(MODELS["motorboat"].astern_m, abs=0.02)
    process.terminate()
    process.communicate(timeout=10)
    assert list(tmp_path.glob("tmp.*")) == []
    with socket.create_server(("127.0.0.1", port)):
        pass


def test_the_script_says_what_is_missing() -> None:
    for settings, said, code in (
        ({"ARDUROVER": "/nowhere/ardurover"}, "no /nowhere/ardurover", 5),
        ({"MODEL": "submarine"}, "motorboat-skid", 2),
    ):
        done = subprocess.run(
            [str(SCRIPT)], env={**os.environ, **settings}, capture_output=True, text=True,
            timeout=10, check=False,
        )  # fmt: skip
        assert done.returncode == code
        assert said in done.stderr
