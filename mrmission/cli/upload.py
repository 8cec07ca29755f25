"""``mrmission upload``: plan an area, upload the missions to the fleet, verify them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from mrmission.cli.areas import read_area
from mrmission.cli.link_options import link_options, read_signing
from mrmission.cli.options import area_options, build_options, plan_options
from mrmission.cli.upload_plan import (
    again,
    capacity_hint,
    earlier_limits,
    make_plan,
    read_missions,
    reported_estimates,
)
from mrmission.cli.upload_run import LinkChoice, ask_limits, run_upload
from mrmission.errors import ConfigError
from mrmission.fleet import Robot
from mrmission.options import PlanOptions

if TYPE_CHECKING:
    from mrmission.vehicle.capacity import Caps, KnownLimits


@click.command()
@area_options
@plan_options
@click.option(
    "--from",
    "from_folder",
    type=click.Path(path_type=Path),
    help="Upload the robot-*.plan files of this folder instead of planning AREA.",
)
@link_options("the K ports of SITL, 5760 + 10 i")
@click.option(
    "--max-distance",
    "max_distance_m",
    type=click.FloatRange(min=0, min_open=True),
    default=1000.0,
    show_default=True,
    help="A vehicle farther than this from its mission's home gets nothing, m.",
)
@click.option(
    "--sortie",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Which trip to upload, where robots go out several times.",
)
@click.option("--simulate", is_flag=True, help="Upload to simulated boats, started for it.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, file_okay=False),
    help="Also leave the plan's files there, what vehicles held before (saved/), and fleet.json: "
    "which vehicle stores what. Simulated boats of --simulate leave neither of these two.",
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
    client: str,
    sign_key_file: Path | None,
    max_distance_m: float,
    sortie: int,
    simulate: bool,
    out: Path | None,
    overwrite: bool,
    as_json: bool,
    **flags: Any,
) -> int:
    """Plan AREA and upload the missions to K vehicles, in parallel, verified.

    First the vehicles are asked how much they hold, and the plan is fitted to the smallest. Then
    each vehicle gets fence, rally points and mission, all of which are read back and compared. A
    vehicle that is armed, absent, far away, or refuses is named in the table; the others get
    theirs, and the same command run again completes the rest. After a failure a vehicle holds
    what it held before, or nothing. Nothing is ever armed.
    """
    from mrmission.vehicle.connection import parse_connections

    if simulate and connect:
        raise ConfigError("--simulate and --connect: choose one")
    parse_connections(connect)
    links = LinkChoice(
        connect=connect,
        client=client,
        signing=None if simulate else read_signing(sign_key_file, client),
    )
    options = build_options(**flags)
    caps = given_caps(ctx, options)
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
            links=links,
            simulate=simulate,
            as_json=as_json,
            record_folder=out or from_folder,
            caps=caps,
            estimates=reported_estimates(from_folder, missions, sortie),
            max_distance_m=max_distance_m,
            sortie=sortie,
        )
    if area is None:
        raise ConfigError("AREA is missing: name a survey area, or a folder of plans with --from")

    if out is not None and not again(out, overwrite):
        from mrmission.results import check_folder

        check_folder(out, overwrite)
    survey = read_area(area, resolution, origin, part, islands)
    note = ""
    if not simulate:
        options, note = fitted(options, ask_limits(options.robots, links), caps)
        earlier = earlier_limits(out) if out is not None and again(out, overwrite) else None
        # A run that completes an earlier one makes the same plan, whoever is there today.
        if earlier is not None and caps == type(caps)():
            options = replace(options, limits=earlier)
    result = make_plan(ctx, survey, options, out, overwrite, note)
    return run_upload(
        result.missions,
        links=links,
        simulate=simulate,
        as_json=as_json,
        record_folder=out,
        caps=caps,
        hint=capacity_hint(survey, result, options),
        estimates={
            r.robot: (t.length_m, t.duration_s)
            for r in result.report.robots
            for t in r.trips
            if t.sortie == sortie
        },
        starts_lonlat=[r.start_lonlat for r in result.report.robots],
        sortie=sortie,
        max_distance_m=max_distance_m,
        title=f"{result.area.name}: upload",
    )


# With --from there is no area.
next(parameter for parameter in upload.params if parameter.name == "area").required = False


def _given(ctx: click.Context, name: str) -> bool:
    """Return whether the user gave an option."""
    return ctx.get_parameter_source(name) not in (None, ParameterSource.DEFAULT)


def given_caps(ctx: click.Context, options: PlanOptions) -> Caps:
    """Return the limits that the user gave, as far as any were given."""
    from mrmission.vehicle.capacity import Caps

    return Caps(
        mission_items=options.limits.mission_items if _given(ctx, "max_items") else None,
        fence_bytes=options.limits.fence_bytes if _given(ctx, "fence_bytes") else None,
    )


def fitted(
    options: PlanOptions, known: dict[int, KnownLimits], caps: Caps
) -> tuple[PlanOptions, str]:
    """Return the options with the limits of the smallest vehicle, and a note on whose they are."""
    from mrmission.vehicle.capacity import capped, smallest

    least = capped(smallest(list(known.values())), caps)
    held = least.limits

    def within(robot: Robot) -> Robot:
        items, size = robot.max_items, robot.fence_bytes
        return replace(
            robot,
            max_items=None if items is None else min(items, held.mission_items),
            fence_bytes=None if size is None else min(size, held.fence_bytes),
        )

    fleet = tuple(within(robot) for robot in options.fleet)
    return (
        replace(options, limits=held, fleet=fleet),
        f"planned for vehicles that hold {least}",
    )


def _unused_with_from(ctx: click.Context) -> list[str]:
    """Return the options given that shape a plan, which ``--from`` would silently ignore."""
    io = {"area", "from_folder", "connect", "client", "sign_key_file", "max_distance_m"}
    io |= {"simulate", "out", "overwrite", "as_json", "sortie"}
    # What a vehicle holds (max_items, fence_bytes) is compared with the files.
    used = io | {"max_items", "fence_bytes"}
    return [
        parameter.opts[0]
        for parameter in ctx.command.params
        if parameter.name is not None
        and parameter.name not in used
        and ctx.get_parameter_source(parameter.name) is not ParameterSource.DEFAULT
    ]
