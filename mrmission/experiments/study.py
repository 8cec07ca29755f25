"""The paper's study from beginning to end: jobs, tables, figures, files."""

from __future__ import annotations

import json
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mrmission
from mrmission.errors import ConfigError
from mrmission.experiments import comparisons as compare
from mrmission.experiments import tables
from mrmission.experiments.driven import drive_plan, plan_in_seconds, save_map
from mrmission.experiments.environments import Environment, environments, free_pixels
from mrmission.experiments.jobs import Job, Result, Work, run_jobs
from mrmission.experiments.random_maps import random_map
from mrmission.experiments.readings import DEFAULTS, Planner, name_of
from mrmission.experiments.regions import (
    Owners,
    owners_of_lanes,
    owners_of_plan,
    regions_geojson,
)
from mrmission.experiments.steps import (
    LANES_BUDGET_S,
    lane_plans,
    least_costs,
    paper_plans,
    stage_times,
)
from mrmission.experiments.tables import ROBOTS, Table
from mrmission.experiments.world import paper_world
from mrmission.mission.files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = "experiments"
FRESH = 1000
"""Fresh maps have the seed of the study plus this."""
FIGURE_5_ROBOTS = 4
SHEET = 12
"""Random maps that are drawn."""
IN_ORDER = ("table-1", "table-2", "table-2-fresh", "figure-4", "published", "balance")
CELL_METHODS = ("crc", "cac", "nrc", "fhk")
NAMES = [name_of(reading) for reading in DEFAULTS]
READINGS: str | list[str] = "all"


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How much of the study is done."""

    maps: int = 200
    fresh_maps: int = 200
    lane_maps: int = 200
    lane_budget_s: float = LANES_BUDGET_S
    environment_budget_s: float = 1.0
    environments: int = 4
    seconds_robots: tuple[int, ...] = (8,)
    seconds_budget_s: float = 1.0
    driven: tuple[str, ...] = ("crc", "cac", "minmax")
    metres_per_px: float = 0.5
    obstacles: tuple[int, ...] = (8, 32, 128, 512)


QUICK = Effort(
    maps=8,
    fresh_maps=4,
    lane_maps=8,
    environment_budget_s=0.3,
    environments=2,
    seconds_robots=(4,),
    seconds_budget_s=0.5,
    driven=("crc",),
    metres_per_px=0.25,
    obstacles=(8, 16, 32),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyOptions:
    """What the user asked for.

    Attributes
    ----------
    out
        The study writes into ``out/experiments``.
    maps
        Folder of the environments; None takes our own.
    """

    out: Path
    maps: Path | None = None
    seed: int = 1
    quick: bool = False
    processes: int = 1
    scheduler: str | None = None
    drive: bool = True

    def __post_init__(self) -> None:
        if self.processes < 1:
            raise ConfigError(f"--processes {self.processes}: must be at least 1")
        if self.seed < 0:
            raise ConfigError(f"--seed {self.seed}: must be 0 or more")

    @property
    def effort(self) -> Effort:
        """Return how much is done."""
        return QUICK if self.quick else Effort()


class Progress:
    """Called when a step of the study begins and after each of its jobs; does nothing."""

    def begin(self, step: str, jobs: int) -> None:
        """Take note that a step with so many jobs begins."""

    def advance(self) -> None:
        """Take note that one job is done."""


class Study:
    """One run: what it has found, and what it has written."""

    def __init__(self, options: StudyOptions, progress: Progress | None = None) -> None:
        self.options = options
        self.folder = options.out / FOLDER
        self._tables: dict[str, Table] = {}
        self.notes: list[str] = []
        self._progress = progress or Progress()
        self._found = environments(options.maps)[: options.effort.environments]
        if options.maps is None:
            self.notes.append(
                "the environments are of our own making: the paper's maps cannot be "
                "redistributed; give their folder with --maps"
            )

    @property
    def tables(self) -> list[Table]:
        """Return the tables in the paper's order, then those it does not have."""
        first = [name for name in IN_ORDER if name in self._tables]
        rest = [name for name in self._tables if name not in IN_ORDER]
        return [self._tables[name] for name in (*first, *rest)]

    def run(self) -> None:
        """Do everything, in order; every table is written as soon as it is there."""
        if self.folder.exists() and not self.folder.is_dir():
            raise ConfigError(f"--out {self.options.out}: {FOLDER} is a file there")
        self._environments()
        self._random_maps()
        self._seconds()
        if self.options.drive:
            self._drive()
        self._complexity()
        self._finish()

    def _jobs(
        self, step: str, work: Work, jobs: Sequence[Job], alone: bool = False
    ) -> list[Result]:
        """Run jobs; `alone`, one after the other in this process."""
        self._progress.begin(step, len(jobs))
        return run_jobs(
            work,
            jobs,
            cache=self.folder / "cache",
            processes=1 if alone else self.options.processes,
            scheduler=None if alone else self.options.scheduler,
            on_done=self._progress.advance,
        )

    def _random_maps(self) -> None:
        effort, seed = self.options.effort, self.options.seed

        def planning(seed: int, count: int) -> list[Job]:
            return [
                {"seed": seed, "number": i, "readings": READINGS, "robots": list(ROBOTS)}
                for i in range(count)
            ]

        maps = self._jobs("random maps, every reading", paper_plans, planning(seed, effort.maps))
        fresh = self._jobs(
            "fresh maps, every reading", paper_plans, planning(seed + FRESH, effort.fresh_maps)
        )
        lanes = self._jobs(
            "random maps, lanes",
            lane_plans,
            [
                {
                    "seed": seed,
                    "number": i,
                    "robots": list(ROBOTS),
                    "time_budget_s": effort.lane_budget_s,
                    "search_seed": seed,
                }
                for i in range(effort.lane_maps)
            ],
        )
        bounds = self._jobs(
            "random maps, bounds",
            least_costs,
            [{"seed": seed, "number": i, "robots": list(ROBOTS)} for i in range(effort.lane_maps)],
        )
        self._table("table-1", tables.table_1(maps))

        def sheet() -> Figure:
            from mrmission.experiments.figures import map_sheet

            return map_sheet([random_map(seed, i) for i in range(min(SHEET, effort.maps))])

        self._figure("random-maps", sheet)
        self._table("table-2", compare.table_2(maps, lanes, bounds))
        self._table("table-2-fresh", compare.table_2_fresh(maps, fresh))
        self._write("table-2-readings.csv", compare.all_scores(maps).csv())
        curves = compare.figure_4_rows(maps, lanes)
        self._table("figure-4", curves)

        def draw() -> Figure:
            from mrmission.experiments.figures import figure_4

            return figure_4(curves.rows, tables.PAPER_TABLE_2)

        self._figure("figure-4", draw)

    def _environments(self) -> None:
        effort = self.options.effort
        plans = self._jobs(
            "environments",
            paper_plans,
            [
                {
                    "source": e.source,
                    "readings": READINGS if e.published else NAMES,
                    "robots": list(ROBOTS),
                }
                for e in self._found
            ],
        )
        lanes = self._jobs(
            "environments, lanes",
            lane_plans,
            [
                {
                    "source": e.source,
                    "robots": list(ROBOTS),
                    "time_budget_s": effort.environment_budget_s,
                    "search_seed": self.options.seed,
                    "drawn": FIGURE_5_ROBOTS,
                }
                for e in self._found
            ],
        )
        for environment, mine, ours in zip(self._found, plans, lanes, strict=True):
            table, wrong = compare.environment_table(environment, mine, ours)
            self._table(f"environment-{environment.name}", table)
            self.notes.extend(f"arithmetically impossible: {line}" for line in wrong)
        found = list(zip(self._found, plans, lanes, strict=True))
        if any(environment.published for environment in self._found):
            pairs = [(environment, mine) for environment, mine, _ in found]
            self._table("published", compare.published_table(pairs))
        self._table("balance", compare.balance_table(found))
        self._figure_6(found)
        for environment, _, ours in found:
            self._figure_5(environment, ours)

    def _figure_5(self, environment: Environment, lanes: Result) -> None:
        free = free_pixels(environment.source)
        if environment.source.startswith("own:"):
            path = self.folder / "maps" / f"{environment.name}.png"
            path.parent.mkdir(parents=True, exist_ok=True)
            save_map(free, path)
        world = paper_world(free)
        planner = Planner(world)
        panels: list[tuple[str, Owners]] = []
        for reading in DEFAULTS:
            if reading.planner in ("CRC", "CAC"):
                plan = planner.plan(reading, FIGURE_5_ROBOTS)
                panels.append(
                    (
                        f"{reading.planner}, maximum {plan.cost.max():,.0f}",
                        owners_of_plan(free, world, reading, plan),
                    )
                )
        cost = lanes["rows"][ROBOTS.index(FIGURE_5_ROBOTS)][0]
        owners = owners_of_lanes(free, world, lanes["drawn"])
        panels.append((f"{compare.OURS}, maximum {cost:,.0f}", owners))
        for title, owners in panels:
            planner_name = title.split(",")[0].lower()
            name = f"{environment.name}-{planner_name}-{FIGURE_5_ROBOTS}"
            self._write(f"regions/{name}.geojson", regions_geojson(owners, name))

        def draw() -> Figure:
            from mrmission.experiments.figures import figure_5

            return figure_5(panels)

        self._figure(f"figure-5-{environment.name}", draw)

    def _figure_6(self, found: Sequence[tuple[Environment, Result, Result]]) -> None:
        panels = []
        for environment, plans, lanes in found:
            ours: dict[str, Any] = {
                reading.planner: (ROBOTS, [row[0] for row in plans["plans"][name_of(reading)]])
                for reading in DEFAULTS
            }
            ours[compare.OURS] = (ROBOTS, [row[0] for row in lanes["rows"]])
            theirs = {
                name: (row.robots, row.max_cost) for name, row in environment.published.items()
            }
            panels.append((environment.name, ours, theirs))

        def draw() -> Figure:
            from mrmission.experiments.figures import figure_6

            return figure_6(panels)

        self._figure("figure-6", draw)

    def _water_job(self, environment: Environment, method: str, robots: int) -> Job:
        metres = self.options.effort.metres_per_px
        return {
            "name": environment.name,
            "source": environment.source,
            "metres_per_px": metres,
            "swath_m": 20.0,
            "clearance_m": 6.0,
            "method": method,
            "robots": robots,
            "time_budget_s": self.options.effort.seconds_budget_s,
        }

    def _seconds(self) -> None:
        jobs = [
            self._water_job(environment, method, robots)
            for environment in self._found
            for robots in self.options.effort.seconds_robots
            for method in (*CELL_METHODS, compare.OURS)
        ]
        results = self._jobs("plans in seconds", plan_in_seconds, jobs)
        self._table("seconds", compare.seconds_table(jobs, results))

    def _drive(self) -> None:
        jobs = [
            {**self._water_job(environment, method, FIGURE_5_ROBOTS), "speedup": 100.0}
            for environment in self._found
            for method in self.options.effort.driven
        ]
        results = self._jobs("driving", drive_plan, jobs, alone=True)
        self._table("driven", compare.driven_table(jobs, results))

    def _complexity(self) -> None:
        jobs = [
            {
                "seed": self.options.seed,
                "number": i,
                "obstacles": obstacles,
                "robots": 8,
                "repeats": 3,
                "readings": NAMES,
                "time_budget_s": LANES_BUDGET_S,
            }
            for i, obstacles in enumerate(self.options.effort.obstacles)
        ]
        results = self._jobs("run times", stage_times, jobs, alone=True)
        self._table("complexity", compare.complexity_table(results))

        def draw() -> Figure:
            from mrmission.experiments.figures import run_times

            return run_times(results, list(compare.ORDERS))

        self._figure("complexity", draw)

    def _finish(self) -> None:
        head = [
            "# The paper's study",
            "",
            f"Seed {self.options.seed}, mrmission {mrmission.__version__}.",
            "",
            *(f"- {note}" for note in self.notes),
            "",
        ]
        body = "\n".join(table.markdown() for table in self.tables)
        self._write("study.md", "\n".join(head) + "\n" + body)
        effort = asdict(self.options.effort)
        record = {
            "seed": self.options.seed,
            "maps": "own" if self.options.maps is None else "given",
            "effort": effort,
            "versions": study_versions(),
            "default_readings": NAMES,
            "notes": self.notes,
        }
        self._write("study.json", json.dumps(record, indent=2) + "\n")

    def _table(self, name: str, table: Table) -> None:
        self._tables[name] = table
        self._write(f"{name}.md", table.markdown())
        self._write(f"{name}.csv", table.csv())

    def _figure(self, name: str, draw: Callable[[], Figure]) -> None:
        from mrmission.experiments.figures import render

        for suffix, data in render(draw()).items():
            self._write(f"{name}.{suffix}", data)

    def _write(self, name: str, data: str | bytes) -> None:
        write_whole(self.folder / name, data, overwrite=True)


def study_versions() -> Mapping[str, str]:
    """Return the versions that the study's numbers depend on."""
    out = {"mrmission": mrmission.__version__, "python": platform.python_version()}
    for name in ("numpy", "shapely", "numba", "rustworkx", "matplotlib"):
        try:
            out[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            out[name] = "not installed"
    return out
