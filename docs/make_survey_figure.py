"""The figure of docs/survey-lines.md, for `python docs/make_figures.py survey-lines`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyproj
import shapely
from make_figures import (
    LAKE,
    REGION,
    WATER,
    fill,
    frame_axes,
    legend,
    line_key,
    lines,
    save,
    scale_bar,
    sheet,
)

from mrmission.cli.areas import read_area
from mrmission.mission import mavlink
from mrmission.model import FleetPlan, LineReport
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.tour.tie_spec import parse_ties

OPTIONS = PlanOptions(
    robots=4,
    method="minmax",
    shore_laps=1,
    tie_lines=parse_ties("5%"),
    angle_deg=75.0,
    time_budget_s=1.0,
)
COLOURS = {"lane": "#6f93a6", "shore": "#005ab4", "tie": "#c4161c", "extra": "#a06a00"}
WORDS = {"lane": "lane", "shore": "lap", "tie": "tie line", "extra": "extra"}
WINDOW = (-340.0, -420.0, -60.0, -220.0)


def ways_m(result: FleetPlan) -> list[tuple[LineReport, np.ndarray]]:
    """Return every line of the missions with its places, local frame."""
    project = pyproj.Proj(result.report.frame)
    out = []
    for mission in result.missions:
        for line in mission.lines:
            items = [
                i
                for i in mission.items[line.from_item : line.to_item + 1]
                if i.command in mavlink.NAVIGATION
            ]
            lon, lat = np.array([[i.y, i.x] for i in items]).T / 1e7
            out.append((line, np.column_stack(project(lon, lat))))
    return out


def name_in_window(axes: Any, line: LineReport, way: np.ndarray, window: shapely.Polygon) -> None:
    """Write a line's name where its longest stretch in the window has its middle."""
    seen = shapely.get_parts(shapely.intersection(shapely.LineString(way), window))
    seen = [part for part in seen if part.length > 25]
    if not seen:
        return
    longest = max(seen, key=lambda part: part.length)
    # lanes side by side: names take turns, so that they don't collide
    share = 0.35 + 0.3 * (sum(map(ord, line.name)) % 2) if line.kind == "lane" else 0.5
    spot = longest.interpolate(share, normalized=True)
    axes.annotate(
        line.name, (spot.x, spot.y), ha="center", va="center", fontsize=5.5,
        color=COLOURS[line.kind], zorder=9,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.6},
    )  # fmt: skip


def draw() -> None:
    """Draw the whole lake, and a part of it with the names of its lines; write the figure."""
    result = plan(read_area(LAKE, None, None, None), OPTIONS)
    rows = ways_m(result)
    figure, grid = sheet(1, 2, 3.3)
    window = shapely.box(*WINDOW)
    for axes, close in ((grid[0, 0], False), (grid[0, 1], True)):
        for area, style in ((result.water_m, WATER), (result.region_m, REGION)):
            seen = shapely.intersection(area, window.buffer(5)) if close else area.simplify(0.7)
            fill(axes, seen, **style)
        for kind, colour in COLOURS.items():
            ways = [way for line, way in rows if line.kind == kind]
            if close:
                ways = [way for way in ways if shapely.LineString(way).intersects(window)]
            lines(axes, ways, colors=colour, linewidths=1.1 if close else 0.5)
        if close:
            for line, way in rows:
                if line.kind != "extra":
                    name_in_window(axes, line, way, window)
        else:
            west, south, east, north = WINDOW
            axes.plot(
                [west, east, east, west, west], [south, south, north, north, south],
                color="black", linewidth=0.7,
            )  # fmt: skip
        frame_axes(axes, WINDOW if close else None)
        scale_bar(axes, 50 if close else 200)
    there = {line.kind for line, _ in rows}
    legend(figure, [line_key(WORDS[k], color=c) for k, c in COLOURS.items() if k in there])
    save(figure, "survey-lines")
