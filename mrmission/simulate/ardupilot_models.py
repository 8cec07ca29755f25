"""What ArduPilot can simulate for mrmission, and the parameter files that go with it.

The files are those of the folder ``sitl/``: read there in a checkout, from the package in a wheel.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mrmission.errors import ConfigError, SimulatorError
from mrmission.simulate.ardupilot_process import SECOND_LINK
from mrmission.simulate.fleet import PORT_STEP

CHECKOUT_SITL = Path(__file__).resolve().parents[2] / "sitl"
PACKAGED_SITL = Path(__file__).resolve().parent / "sitl"


@dataclass(frozen=True, kw_only=True, slots=True)
class Model:
    """A hull or frame that ArduPilot simulates.

    Parameters
    ----------
    vehicle : str
        boat, rover or copter: which program.
    frame : str
        ArduPilot's name of the model.
    files : tuple of str
        Parameter files of ``sitl/``; a later one wins.
    astern_m : float
        How far it goes astern before it is ready: for its first second, SITL has no servo output,
        which its boats take for full astern, and they coast on.
    """

    vehicle: str
    frame: str
    files: tuple[str, ...]
    astern_m: float = 0.0


MODELS: Mapping[str, Model] = {
    "motorboat": Model(
        vehicle="boat", frame="motorboat", files=("common.parm", "boat.parm"), astern_m=8.0
    ),
    "motorboat-skid": Model(
        vehicle="boat",
        frame="motorboat-skid",
        files=("common.parm", "boat.parm", "skid.parm"),
        astern_m=8.0,
    ),
    "pivoting": Model(
        vehicle="boat",
        frame="rover-skid",
        files=("common.parm", "boat.parm", "skid.parm", "pivot.parm"),
    ),
    "rover": Model(vehicle="rover", frame="rover", files=("common.parm", "rover.parm")),
    "quad": Model(vehicle="copter", frame="quad", files=("common.parm", "copter.parm")),
}
"""By the name that ``--model`` takes: a steered boat, one that turns on the spot as slowly as its
way through the water lets it, one that does so at PIVOT_RATE, a car, a copter."""


def parameter_file(name: str) -> Path:
    """Return the path of a parameter file of ``sitl/``, from the checkout or from the wheel."""
    for folder in (PACKAGED_SITL, CHECKOUT_SITL):
        if (folder / name).is_file():
            return folder / name
    raise SimulatorError(f"parameter file {name}: not in {CHECKOUT_SITL} nor in {PACKAGED_SITL}")


def read_parameters(path: Path) -> dict[str, float]:
    """Return the names and values of a parameter file, in its order.

    Lines are ``NAME VALUE``, ``NAME,VALUE`` or ``NAME=VALUE``; what follows ``#`` is a comment.

    Raises
    ------
    ConfigError
        When the file can't be read, or a line is something else.
    """
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"parameter file {path}: {error}") from error
    values: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.partition("#")[0].replace(",", " ").replace("=", " ").split()
        if not words:
            continue
        try:
            name, value = words[0].upper(), float(words[1])
        except (IndexError, ValueError):
            raise ConfigError(
                f"parameter file {path}, line {number}: {line.strip()!r} is not NAME VALUE"
            ) from None
        if len(words) > 2 or len(name) > 16 or not math.isfinite(value):
            raise ConfigError(
                f"parameter file {path}, line {number}: {line.strip()!r} is not NAME VALUE"
            )
        values[name] = value
    return values


def survey_parameters(model: str = "motorboat") -> dict[str, float]:
    """Return what ``sitl/*.parm`` sets for a model: the parameters that a survey needs."""
    values: dict[str, float] = {}
    for name in MODELS[model].files:
        values.update(read_parameters(parameter_file(name)))
    return values


def check_base_port(base_port: int, count: int) -> None:
    """Refuse a first port from which not all vehicles have ports.

    Raises
    ------
    ConfigError
        When it is out of range.
    """
    last_port = base_port + PORT_STEP * (count - 1) + SECOND_LINK
    if base_port != 0 and not (base_port >= 1024 and last_port <= 65535):
        raise ConfigError(
            f"--base-port {base_port}: {count} vehicles need ports up to {last_port}, "
            "there are 1024 to 65535"
        )
