"""Trials of a boat for the tests of its behaviour: of the light one, then of an ArduRover."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fleets import Pool
from seatrial import LightTrial, LinkTrial, Trial
from sim_client import LAT, LON

from mrmission.simulate import ArdupilotFleet
from mrmission.simulate.ardupilot_models import MODELS, read_parameters, survey_parameters

ENGINES = ("light", pytest.param("ardupilot", marks=pytest.mark.ardupilot))
SPEEDUP = 10.0
COLD_S = 43.0
"""Seconds on the water until an ArduRover navigates; what a light boat is told in a cold start."""
BARE = """\
# ArduPilot's own defaults, and what makes it the simulated motorboat.
FRAME_CLASS 2
INITIAL_MODE 4
MODE_CH 0
INS_ACCOFFS_X 0.001
INS_ACCOFFS_Y 0.001
INS_ACCOFFS_Z 0.001
INS_ACCSCAL_X 1.001
INS_ACCSCAL_Y 1.001
INS_ACCSCAL_Z 1.001
INS_ACC2OFFS_X 0.001
INS_ACC2OFFS_Y 0.001
INS_ACC2OFFS_Z 0.001
INS_ACC2SCAL_X 1.001
INS_ACC2SCAL_Y 1.001
INS_ACC2SCAL_Z 1.001
"""


class ColdFleet(ArdupilotFleet):
    """A fleet that is handed over as soon as it talks, long before it is ready."""

    async def wait_ready(self) -> None:
        """Do not wait."""


@contextlib.contextmanager
def afloat(
    engine: str,
    pool: Pool,
    folder: Path,
    *,
    cold: bool = False,
    bare: bool = False,
    hasty: bool = False,
    speedup: float = SPEEDUP,
    model: str = "motorboat",
    **parameters: float,
) -> Iterator[Trial]:
    """One boat of an engine, and a station that talks to it.

    `cold` hands it over while it starts up; `bare` leaves the parameters of ``sitl/`` away;
    `hasty` talks to it before it answers, until its ``greet`` is called.
    """
    # Fences are the business of the tests that say so.
    given = {"FENCE_ENABLE": 0.0, **parameters}
    if engine == "light":
        usual = {} if bare else survey_parameters(model)
        yield LightTrial(
            kind=MODELS[model].vehicle,
            ready_s=COLD_S if cold else 0.0,
            parameters={**usual, **given},
        )
        return
    file = folder / "bare.parm"
    file.write_text(BARE)
    read_parameters(file)
    pool.drop()
    fleet = (ColdFleet if cold else ArdupilotFleet)(
        count=1, home_lonlat=(LON, LAT), base_port=0, speedup=speedup, parameters=given,
        parameter_files=[file] if bare else None, model=model,
    )  # fmt: skip
    try:
        asyncio.run(fleet.start())
        trial = LinkTrial(fleet.ports[0], hasty=hasty)
        with contextlib.closing(trial):
            yield trial
    finally:
        fleet.close()


@pytest.fixture(params=ENGINES)
def trial_of(
    request: pytest.FixtureRequest, ardupilot_pool: Pool, tmp_path: Path
) -> Iterator[Callable[..., Trial]]:
    """Call it for a boat: with parameters, and `cold` or `bare` (see :func:`afloat`)."""
    with contextlib.ExitStack() as stack:
        yield lambda **how: stack.enter_context(
            afloat(request.param, ardupilot_pool, tmp_path, **how)
        )


@pytest.fixture(
    params=("light", pytest.param("ardupilot", marks=pytest.mark.ardupilot(program="arducopter")))
)
def copter_of(
    request: pytest.FixtureRequest, ardupilot_pool: Pool, tmp_path: Path
) -> Iterator[Callable[..., Trial]]:
    """Call it for a copter on the ground, ready to be armed."""
    with contextlib.ExitStack() as stack:
        yield lambda **how: stack.enter_context(
            afloat(request.param, ardupilot_pool, tmp_path, model="quad", **how)
        )


@pytest.fixture
def trial(trial_of: Callable[..., Trial]) -> Trial:
    """A boat that is ready, in HOLD, with the parameters of ``sitl/`` and no fence."""
    return trial_of()


@pytest.fixture(scope="module", params=ENGINES)
def moored(
    request: pytest.FixtureRequest, ardupilot_pool: Pool, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Trial]:
    with afloat(request.param, ardupilot_pool, tmp_path_factory.mktemp("moored")) as trial:
        yield trial


@pytest.fixture
def standing(moored: Trial) -> Trial:
    """A boat with empty lists that other tests of the module talk to as well."""
    for kind in (0, 1, 2):
        for _ in range(12):
            if moored.clear(kind) == 0:
                break
            # A transfer that the last test broke off is held for eight seconds.
            moored.wait(1.0)
    moored.wait(0.5)
    moored.forget()
    return moored
