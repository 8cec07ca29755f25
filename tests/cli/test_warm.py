"""After ``mrmission warm`` no plan compiles anything."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = """
import sys
from pathlib import Path
from click.testing import CliRunner
from mrmission.area.geojson import read_survey_area
from mrmission.cli.warm import warm
from mrmission.options import PlanOptions
from mrmission.pipeline import plan

def kernels():
    return {
        (f.py_func.__module__, f.py_func.__name__): len(f.signatures)
        for name, module in list(sys.modules.items()) if name.startswith("mrmission")
        for f in vars(module).values() if hasattr(f, "nopython_signatures")
    }

CliRunner().invoke(warm, standalone_mode=False, catch_exceptions=False)
warmed = kernels()
print(sum(warmed.values()))
area = read_survey_area(Path(sys.argv[1]))
for more in ({}, {"turn_radius_m": 5.0}, {"separation_m": 40.0}):
    plan(area, PlanOptions(robots=3, swath_m=20.0, time_budget_s=0.1, **more))
    for kernel, count in sorted(kernels().items()):
        if count > warmed.get(kernel, 0):
            print("compiled for", more, *kernel)
"""
HARBOUR = Path(__file__).parents[2] / "geofences" / "harbour.geojson"


def test_plans_compile_nothing_that_warm_has_not() -> None:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(HARBOUR)], capture_output=True, text=True, check=True
    )
    count, *new = done.stdout.splitlines()
    assert int(count) > 20
    assert new == []
