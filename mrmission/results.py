"""The folder of a plan: which files it holds, written whole or not at all."""

from __future__ import annotations

import re
from pathlib import Path

from mrmission.errors import ConfigError
from mrmission.mission.files import mission_names, write_whole
from mrmission.model import FleetPlan

_OWN = re.compile(r"robot-\d+(-sortie-\d+)?\.(plan|waypoints)")


def check_folder(folder: Path, overwrite: bool) -> None:
    """Refuse a folder that holds a plan already, before any work is done.

    Raises
    ------
    ConfigError
        When the folder is a file, or holds a plan and `overwrite` is false.
    """
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"--out {folder}: is a file; name a folder")
    if not overwrite and folder.is_dir():
        there = sorted(p.name for p in folder.iterdir() if _is_result(p.name))
        if there:
            raise ConfigError(
                f"--out {folder}: holds a plan already ({there[0]}); name another folder, "
                "or give --overwrite"
            )


def _is_result(name: str) -> bool:
    fixed = {"report.json", "tours.geojson", "tours.kml", "lines.csv", "map.html", "area.geojson"}
    return name in fixed or _OWN.fullmatch(name) is not None


def write_results(plan: FleetPlan, folder: Path, overwrite: bool) -> list[Path]:
    """Write a plan's files and return them: everything is made before the first byte is written.

    With `overwrite`, mission files of an earlier plan that this one does not have are removed:
    a robot-7.plan of yesterday must not be loaded today.
    """
    from mrmission.mission.geojson import tours_geojson
    from mrmission.mission.kml import tours_kml
    from mrmission.mission.lines_csv import lines_csv
    from mrmission.mission.qgc_plan import plan_text
    from mrmission.mission.wpl import waypoints_text
    from mrmission.report.map_page import map_html
    from mrmission.report.metrics import report_text

    files: dict[str, str] = {}
    for name, mission in zip(mission_names(plan.missions), plan.missions, strict=True):
        home = plan.report.robots[mission.robot - 1].start_lonlat
        files[f"{name}.plan"] = plan_text(mission, home)
        files[f"{name}.waypoints"] = waypoints_text(mission)
    files["report.json"] = report_text(plan)
    files["tours.geojson"] = tours_geojson(plan.missions)
    files["tours.kml"] = tours_kml(plan.missions)
    files["lines.csv"] = lines_csv(plan.report.lines)
    files["map.html"] = map_html(plan)
    if plan.area.image is not None:
        from mrmission.area.geojson import free_area_geojson

        files["area.geojson"] = free_area_geojson(plan.area)
    stale = _stale(folder, plan.area.source, set(files)) if overwrite else []
    for name, text in files.items():
        write_whole(folder / name, text, overwrite)
    for old in stale:
        old.unlink(missing_ok=True)
    return [folder / name for name in files]


def _stale(folder: Path, source: str, names: set[str]) -> list[Path]:
    """Return the files of an earlier plan in a folder that the new plan does not replace."""
    if not folder.is_dir():
        return []
    old = [p for p in sorted(folder.iterdir()) if p.name not in names]
    stale = [p for p in old if _OWN.fullmatch(p.name)]
    # an image's water, left by an earlier plan; but the area itself may bear this name
    image_area = folder / "area.geojson"
    if image_area in old and (folder / "report.json").is_file():
        given = Path(source)
        if not (given.exists() and given.samefile(image_area)):
            stale.append(image_area)
    return stale
