"""CPU of a whole ``mrmission plan``: a lake of 1 km² with ten islands, six boats.

The figure that counts is the CPU of the process with its start-up; it is printed, and held only to
a generous multiple of what importing the same libraries costs on the same machine.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import shapely
from lakes import area_of, geojson_of, star

pytestmark = pytest.mark.slow


def square_kilometre() -> shapely.Polygon:
    """A lake of 1 km² of water with ten islands, about 300 vertices."""
    rng = np.random.default_rng(20)
    angle = np.linspace(0, 2 * np.pi, 160, endpoint=False)
    wave = 1 + 0.12 * np.sin(3 * angle) + 0.08 * np.sin(5 * angle + 1) + 0.03 * np.sin(17 * angle)
    lake = shapely.Polygon(600 * wave[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))
    inner = lake.buffer(-60)
    while len(lake.interiors) < 10:
        island = star(rng, tuple(rng.uniform(-550, 550, 2)), float(rng.uniform(20, 60)), 14)
        if inner.contains(island):
            inner = inner - island.buffer(40)
            lake = shapely.Polygon(lake.exterior, [*lake.interiors, island.exterior])
    return shapely.affinity.scale(lake, *([(1e6 / lake.area) ** 0.5] * 2), origin=(0, 0))


def cpu_s(command: list[str], folder: Path) -> float:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0, done.stderr
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def numpy_pass_s(vertices: int) -> float:
    """One pass over every vertex for every lane, as the scan does, in numpy."""
    heights = np.random.default_rng(0).random(vertices)
    lanes = np.linspace(0, 1, 130)
    start = time.process_time()
    for _ in range(20):
        np.count_nonzero(heights[:, None] < lanes[None, :])
    return (time.process_time() - start) / 20


def test_plan_of_a_square_kilometre(tmp_path: Path) -> None:
    lake = square_kilometre()
    assert lake.is_valid
    assert lake.area == pytest.approx(1e6, rel=1e-6)
    assert len(lake.interiors) == 10
    (tmp_path / "lake.geojson").write_text(geojson_of(area_of(lake)))
    command = [
        sys.executable, "-m", "mrmission", "plan", "lake.geojson", "--k", "6", "--swath", "10",
        "--overlap", "0", "--clearance", "0", "--out", "out", "--overwrite",
    ]  # fmt: skip
    cpu_s(command, tmp_path)  # the first compiles
    plan_s = min(cpu_s(command, tmp_path) for _ in range(2))
    libraries = "import numpy, shapely, pyproj, numba, rustworkx, rich.table, click"
    import_s = min(cpu_s([sys.executable, "-c", libraries], tmp_path) for _ in range(2))
    pass_s = numpy_pass_s(len(shapely.get_coordinates(lake)))
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["coverage"] >= 0.9995
    print(  # noqa: T201
        f"\nplan of 1 km², 10 islands, swath 10 m, k = 6: {plan_s:.2f} s CPU, "
        f"{import_s:.2f} s of imports alone ({plan_s / import_s:.1f} times), "
        f"{plan_s / pass_s:.0f} numpy passes over vertices x lanes"
    )
    assert plan_s < 25 * import_s
