"""``mrmission upload``: plan an area, upload the missions to the fleet, verify them."""

from __future__ import annotations

import asyncio
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from mrmission.cli.areas import read_area
from mrmission.cli.collector import paused_collector
from mrmission.cli.options import area_options, assumed_options, build_options, plan_options
from mrmission.errors import ConfigError, InputError, VehicleError
from mrmission.model import FleetPlan, Mission, SurveyArea
from mrmission.options import PlanOptions, VehicleLimits

if TYPE_CHECKING:
    from mrmission.vehicle.upload import UploadRow, UploadTimeouts

_PLAN_FILE = re.compile(r"robot-(\d+)(?:-sortie-(\d+))?\.plan")


@click.command()
@area_options
@plan_options
@click.option(
    "--from",
    "from_folder",
    type=click.Path(path_type=Path),
    help="Upload the robot-*.plan files of this folder instead of planning AREA.",
)
@click.option(
    "--connect",
    multiple=True,
    metavar="LINK",
    help="tcpout://HOST:PORT, udpin://HOST:PORT, udpout://HOST:PORT, serial://DEVICE:BAUD; once "
    "per robot, or one link that carries all.  [default: the K ports of SITL, 5760 + 10 i]",
)
@click.option("--simulate", is_flag=True, help="Upload to simulated boats, started for it.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Also leave the plan's files there, and fleet.json: which vehicle stores what.",
)
@click.option("--overwrite", is_flag=True, help="Replace the results of an earlier plan in --out.")
@click.option("--json", "as_json", is_flag=True, help="Print the rows as JSON instead of a table.")
@click.pass_context
def upload(
    ctx: click.Context,
    /,
    area: Path | None,
    resolution: float | None,
    origin: tuple[float, float] | None,
    part: int | None,
    islands: bool,
    from_folder: Path | None,
    connect: tuple[str, ...],
    simulate: bool,
    out: Path | None,
    overwrite: bool,
    as_json: bool,
    **flags: Any,
) -> int:
    """Plan AREA and upload the missions to K vehicles, in parallel, verified.

    Each vehicle gets fence, rally points and mission, all of which are read back and compared. A
    vehicle that is armed, absent, or refuses is named in the table; the others get theirs, and the
    same command run again completes the rest. Nothing is ever armed.
    """
    from mrmission.vehicle.connection import parse_connections

    if simulate and connect:
        raise ConfigError("--simulate and --connect: choose one")
    parse_connections(connect)
    options = build_options(**flags)
    if from_folder is not None:
        if area is not None:
            raise ConfigError(f"--from {from_folder} and AREA {area}: choose one")
        unused = _unused_with_from(ctx)
        if unused:
            raise ConfigError(
                f"--from {from_folder} and {', '.join(unused)}: the plans are made already; leave "
                "one out"
            )
        missions = read_missions(from_folder)
        return run_upload(
            missions,
            connect=connect,
            simulate=simulate,
            as_json=as_json,
            record_folder=out or from_folder,
            limits=options.limits,
        )
    if area is None:
        raise ConfigError("AREA is missing: name a survey area, or a folder of plans with --from")

    if out is not None and not _again(out, overwrite):
        from mrmission.results import check_folder

        check_folder(out, options.robots, overwrite)
    survey = read_area(area, resolution, origin, part, islands)
    result = _plan(ctx, survey, options, out, overwrite)
    return run_upload(
        result.missions,
        connect=connect,
        simulate=simulate,
        as_json=as_json,
        record_folder=out,
        limits=options.limits,
        hint=capacity_hint(survey, result, options),
        estimates={r.robot: (r.length_m, r.duration_s) for r in result.report.robots},
        starts_lonlat=[r.start_lonlat for r in result.report.robots],
        title=f"{result.area.name}: upload",
    )


# With --from there is no area.
next(parameter for parameter in upload.params if parameter.name == "area").required = False


def _unused_with_from(ctx: click.Context) -> list[str]:
    """Return the options given that shape a plan, which ``--from`` would silently ignore."""
    # What a vehicle holds (max_items, fence_bytes) is compared with the files.
    io = {"area", "from_folder", "connect", "simulate", "out", "overwrite", "as_json"}
    used = io | {"max_items", "fence_bytes"}
    return [
        parameter.opts[0]
        for parameter in ctx.command.params
        if parameter.name is not None
        and parameter.name not in used
        and ctx.get_parameter_source(parameter.name) is not ParameterSource.DEFAULT
    ]


def _again(out: Path, overwrite: bool) -> bool:
    """Tell whether `out` holds an upload that the same command may complete."""
    from mrmission.vehicle.record import FILE_NAME

    return not overwrite and (out / FILE_NAME).exists()


@paused_collector()
def _plan(
    ctx: click.Context, survey: SurveyArea, options: PlanOptions, out: Path | None, overwrite: bool
) -> FleetPlan:
    """Plan, print what was assumed, and leave the files where they are wanted."""
    from mrmission.cli.progress import stages
    from mrmission.pipeline import plan
    from mrmission.report.units import assumed_lines
    from mrmission.results import write_results

    with stages() as say:
        result = plan(survey, options, assumed_options(ctx, options), on_stage=say)
    assumed = ", ".join(f"{name} {value}" for name, value in assumed_lines(result.report))
    if assumed:
        click.echo(f"assumed (not given): {assumed}", err=True)
    for note in result.report.notes:
        click.echo(f"note: {note}", err=True)
    if out is not None:
        if _again(out, overwrite):
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
    from mrmission.mission.qgc_plan import plan_text

    for mission in result.missions:
        path = folder / f"robot-{mission.robot}.plan"
        home = result.report.robots[mission.robot - 1].start_lonlat
        if not path.is_file() or path.read_text(encoding="utf-8") != plan_text(mission, home):
            raise ConfigError(
                f"--out {folder}: holds another plan ({path.name} differs); name another folder, "
                "or give --overwrite"
            )


def read_missions(folder: Path) -> list[Mission]:
    """Return the missions of a folder's ``robot-*.plan`` files, by robot and sortie.

    Raises
    ------
    InputError
        When there are none.
    PlanFormatError
        When one cannot be read.
    """
    from mrmission.mission.qgc_plan import read_plan

    if not folder.is_dir():
        raise InputError(f"--from {folder}: is not a folder; name one that `mrmission plan` left")
    paths = [path for path in folder.iterdir() if _PLAN_FILE.fullmatch(path.name)]
    if not paths:
        raise InputError(
            f"--from {folder}: holds no robot-1.plan; name a folder that `mrmission plan` left"
        )
    return sorted((read_plan(path) for path in paths), key=lambda m: (m.robot, m.sortie))


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


def run_upload(
    missions: Sequence[Mission],
    *,
    connect: Sequence[str] = (),
    simulate: bool = False,
    as_json: bool = False,
    record_folder: Path | None = None,
    limits: VehicleLimits | None = None,
    hint: Callable[[int], str] | None = None,
    estimates: Mapping[int, tuple[float, float]] | None = None,
    starts_lonlat: Sequence[tuple[float, float]] | None = None,
    title: str = "Upload",
    timeouts: UploadTimeouts | None = None,
) -> int:
    """Upload missions, print the table, keep the record; return the exit code.

    Parameters
    ----------
    missions
        One or more per robot; the first sortie of each is uploaded.
    connect
        Links; none means the ports of as many SITL instances.
    simulate
        Upload to simulated boats that are started for it and stopped afterwards.
    as_json
        Print JSON instead of the table.
    record_folder
        Where ``fleet.json`` is kept, if anywhere.
    limits, hint, estimates, timeouts
        See :func:`mrmission.vehicle.upload.upload_fleet`.
    starts_lonlat
        Where simulated boats lie; each mission's home where not given.
    title
        Title of the table.

    Returns
    -------
    int
        0 when every vehicle was verified, 5 otherwise.
    """
    from mrmission.cli.upload_table import upload_json, upload_progress, upload_table
    from mrmission.vehicle.record import read_record, record_of, write_record
    from mrmission.vehicle.upload import UploadStatus, first_sorties

    first = first_sorties(missions)
    previous = (
        {record.robot: record.system_id for record in read_record(record_folder)}
        if record_folder is not None and not simulate
        else {}
    )
    with upload_progress([mission.robot for mission in first]) as progress:
        rows = asyncio.run(
            _upload(
                missions,
                connect=connect,
                simulated=_fleet(first, starts_lonlat, limits) if simulate else None,
                progress=progress,
                limits=limits,
                hint=hint,
                assignment=previous,
                estimates=estimates,
                timeouts=timeouts,
            )
        )
    # Simulated boats are gone when this ends; a record of them would mislead the real upload.
    if record_folder is not None and not simulate:
        by_robot = {mission.robot: mission for mission in first}
        write_record(
            record_folder,
            [
                record_of(by_robot[row.robot], system_id=row.system_id, link=row.link)
                for row in rows
                if row.verified and row.system_id is not None
            ],
            forget=[
                row.robot
                for row in rows
                if not row.verified and row.status is not UploadStatus.ABSENT
            ],
        )
    if as_json:
        sys.stdout.write(upload_json(rows, simulated=simulate))
    else:
        _show(rows, upload_table(rows, title + (" to simulated boats" if simulate else "")))
    return 0 if all(row.verified for row in rows) else VehicleError.exit_code


def _show(rows: Sequence[UploadRow], table: Any) -> None:
    from rich.console import Console

    console = Console() if sys.stdout.isatty() else Console(width=200)
    console.print(table)
    verified = sum(row.verified for row in rows)
    text = f"{verified} of {len(rows)} vehicles verified; nothing was armed"
    if verified < len(rows):
        text += "; the same command completes the rest"
    click.echo(text, err=True)


async def _upload(
    missions: Sequence[Mission], *, connect: Sequence[str], simulated: Any, **options: Any
) -> list[UploadRow]:
    from mrmission.vehicle.upload import upload_fleet

    if simulated is None:
        return await upload_fleet(missions, connect, **options)
    async with simulated as fleet:
        return await upload_fleet(missions, fleet.links, **options)


def _fleet(
    missions: Sequence[Mission],
    starts_lonlat: Sequence[tuple[float, float]] | None,
    limits: VehicleLimits | None,
) -> Any:
    """Return a simulated fleet at the missions' homes, with the memory that was planned for."""
    from mrmission.simulate import SimulatedFleet

    starts = list(starts_lonlat or ())
    if len(starts) != len(missions):
        starts = [home_lonlat(mission) for mission in missions]
    standard, wanted = VehicleLimits(), limits or VehicleLimits()
    parameters: dict[str, float] = {}
    if wanted.mission_items > standard.mission_items:
        parameters["BRD_SD_MISSION"] = math.ceil((wanted.mission_items * 15 + 4) / 1024)
    if wanted.fence_bytes > standard.fence_bytes:
        parameters["BRD_SD_FENCE"] = math.ceil(wanted.fence_bytes / 1024)
    return SimulatedFleet(
        count=len(missions), starts_lonlat=starts, base_port=0, parameters=parameters
    )


def home_lonlat(mission: Mission) -> tuple[float, float]:
    """Return where a mission starts: its home, else a rally point, else a corner of its fence."""
    if mission.items:
        return mission.items[0].y / 1e7, mission.items[0].x / 1e7
    if mission.rally:
        return mission.rally[0].lon_e7 / 1e7, mission.rally[0].lat_e7 / 1e7
    for polygon in mission.fence:
        lat_e7, lon_e7 = polygon.points_e7[0].tolist()
        return lon_e7 / 1e7, lat_e7 / 1e7
    return 0.0, 0.0
