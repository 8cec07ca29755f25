"""The plan of an upload: made for what the fleet holds, or read from a folder."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import click

from mrmission.cli.collector import paused_collector
from mrmission.cli.options import assumed_options
from mrmission.errors import ConfigError, InputError, PlanFormatError
from mrmission.model import FleetPlan, Mission, SurveyArea
from mrmission.options import PlanOptions, VehicleLimits


def again(out: Path, overwrite: bool) -> bool:
    """Tell whether `out` holds an upload that the same command may complete."""
    from mrmission.vehicle.record import FILE_NAME

    return not overwrite and (out / FILE_NAME).exists()


def earlier_limits(folder: Path) -> VehicleLimits | None:
    """Return the limits that a folder's plan was made for, None where it does not say.

    Raises
    ------
    PlanFormatError
        When its report cannot be read.
    """
    path = folder / "report.json"
    if not path.is_file():
        return None
    try:
        return VehicleLimits(**json.loads(path.read_text(encoding="utf-8"))["options"]["limits"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise PlanFormatError(
            f"{path}: says nothing of limits ({error}); give --overwrite"
        ) from error


@paused_collector()
def make_plan(
    ctx: click.Context,
    survey: SurveyArea,
    options: PlanOptions,
    out: Path | None,
    overwrite: bool,
    note: str = "",
) -> FleetPlan:
    """Plan, print what was assumed, and leave the files where they are wanted.

    Parameters
    ----------
    ctx, survey, options
        Of the command; options with the limits of the fleet.
    out, overwrite
        Where files are left; an earlier upload of the same plan may lie there.
    note
        A note more for the report: whose the limits are.
    """
    from mrmission.cli.progress import stages
    from mrmission.pipeline import plan
    from mrmission.report.units import assumed_lines
    from mrmission.results import write_results

    with stages() as say:
        result = plan(survey, options, assumed_options(ctx, options), on_stage=say)
    if note:
        report = replace(result.report, notes=(*result.report.notes, note))
        result = replace(result, report=report)
    assumed = ", ".join(f"{name} {value}" for name, value in assumed_lines(result.report))
    if assumed:
        click.echo(f"assumed (not given): {assumed}", err=True)
    for text in result.report.notes:
        click.echo(f"note: {text}", err=True)
    if out is not None:
        if again(out, overwrite):
            check_same_plan(out, result)
        else:
            write_results(result, out, overwrite)
    return result


def check_same_plan(folder: Path, result: FleetPlan) -> None:
    """Refuse a folder whose ``.plan`` files are of another plan.

    Raises
    ------
    ConfigError
        Naming the first file that differs.
    """
    from mrmission.mission.files import mission_names
    from mrmission.mission.qgc_plan import plan_text

    for name, mission in zip(mission_names(result.missions), result.missions, strict=True):
        path = folder / f"{name}.plan"
        home = result.report.robots[mission.robot - 1].start_lonlat
        if not path.is_file() or path.read_text(encoding="utf-8") != plan_text(mission, home):
            raise ConfigError(
                f"--out {folder}: holds another plan ({path.name} differs); name another folder, "
                "or give --overwrite"
            )


def read_missions(folder: Path, *, named: str = "--from ") -> list[Mission]:
    """Return the missions of a folder's ``robot-*.plan`` files, by robot and sortie.

    Parameters
    ----------
    folder
        Where they lie.
    named
        How the command names the folder.

    Raises
    ------
    InputError
        When there are none.
    PlanFormatError
        When one cannot be read.
    """
    from mrmission.mission.files import plan_files
    from mrmission.mission.qgc_plan import read_plan

    if not folder.exists():
        raise InputError(f"{named}{folder}: no such folder; name one that `mrmission plan` left")
    if not folder.is_dir():
        raise InputError(f"{named}{folder}: is not a folder; name one that `mrmission plan` left")
    paths = [path for _, _, path in plan_files(folder)]
    if not paths:
        raise InputError(
            f"{named}{folder}: holds no robot-1.plan; name a folder that `mrmission plan` left"
        )
    return sorted((read_plan(path) for path in paths), key=lambda m: (m.robot, m.sortie))


def reported_estimates(
    folder: Path, missions: Sequence[Mission], sortie: int = 1
) -> dict[int, tuple[float, float]]:
    """Return robot to (length_m, duration_s) of one sortie, as a folder's report has them.

    A robot whose mission is not the one of the report, because somebody has edited the file, is
    left out, and so are all where there is no report.
    """
    from mrmission.vehicle.job import path_length_m

    try:
        rows = json.loads((folder / "report.json").read_text(encoding="utf-8"))["robots"]
        told = {
            int(robot["robot"]): (float(row["length_m"]), float(row["duration_s"]))
            for robot in rows
            # a report of before there were sorties has the robot's own numbers alone
            for row in robot.get("sorties") or [{**robot, "sortie": 1}]
            if row["sortie"] == sortie
        }
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return {
        mission.robot: told[mission.robot]
        for mission in missions
        if mission.robot in told
        and mission.sortie == sortie
        and math.isclose(path_length_m(mission), told[mission.robot][0], rel_tol=1e-3, abs_tol=1.0)
    }


def capacity_hint(
    survey: SurveyArea, result: FleetPlan, options: PlanOptions
) -> Callable[[int], str]:
    """Return a function that says which swath or k fits vehicles of a given memory.

    The items of a robot go about as 1/swath, and are shared by k; what is named was planned
    (without its fence) and found to fit.
    """
    most = max((len(mission.items) for mission in result.missions), default=0)

    def fits(trial: PlanOptions, items: int) -> float:
        """Return by how much the longest mission is too long: 1 or less fits."""
        from mrmission.pipeline import plan

        missions = plan(survey, replace(trial, fence=False)).missions
        return max(len(mission.items) for mission in missions) / items

    def hint(items: int) -> str:
        found = []
        swath_m, excess = options.swath_m, most / items
        for _ in range(6):
            swath_m = math.ceil(swath_m * excess * 10.3) / 10
            excess = max(1.03, fits(replace(options, swath_m=swath_m), items))
            if excess == 1.03:
                found.append(f"--swath {swath_m:g}")
                break
        robots, excess = options.robots, most / items
        for _ in range(4):
            robots = max(robots + 1, math.ceil(robots * excess))
            if robots > 4 * options.robots + 8 or len(options.starts_lonlat) > 1:
                break
            excess = fits(replace(options, robots=robots), items)
            if excess <= 1:
                found.append(f"--k {robots}")
                break
        if not found:
            return "choose a much wider --swath"
        return " or ".join(found) + (" would fit" if len(found) == 1 else " would fit, each alone")

    return hint
