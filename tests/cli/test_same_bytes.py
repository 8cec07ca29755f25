"""The same command leaves the same bytes, whatever the processor can do."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

AREAS = Path(__file__).parents[2] / "geofences"


def _spared() -> str:
    """Return what numpy would use on this processor and can do without."""
    core = np._core._multiarray_umath  # type: ignore[attr-defined]
    has = core.__cpu_features__
    return " ".join(name for name in core.__cpu_dispatch__ if has.get(name))


def _left_by(options: list[str], out: Path, **variables: str) -> dict[str, bytes]:
    command = [sys.executable, "-m", "mrmission", "plan", *options, "--out", str(out)]
    done = subprocess.run(
        command, env={**os.environ, **variables}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return {path.name: path.read_bytes() for path in sorted(out.iterdir())}


@pytest.mark.parametrize(
    "options",
    [
        ["harbour.geojson", "--k", "3", "--swath", "8", "--time-budget", "0.3"],
        ["harbour.geojson", "--k", "2", "--swath", "12", "--turn-radius", "6"],
        ["demo_lake.geojson", "--k", "3", "--endurance", "45min", "--time-budget", "0.3"],
        ["moose_lake.geojson", "--k", "4", "--swath", "40", "--method", "crc"],
    ],
    ids=lambda options: " ".join(options[1:]),
)
def test_a_simpler_processor_makes_the_same_files(options: list[str], tmp_path: Path) -> None:
    spared = _spared()
    if not spared:
        pytest.skip("ONE PROCESSOR ONLY: numpy has nothing to do without here")
    asked = [str(AREAS / options[0]), *options[1:]]
    here = _left_by(asked, tmp_path / "here")
    there = _left_by(
        asked, tmp_path / "there", NPY_DISABLE_CPU_FEATURES=spared, OPENBLAS_CORETYPE="Prescott"
    )
    assert here.keys() == there.keys()
    assert [name for name in here if here[name] != there[name]] == []
