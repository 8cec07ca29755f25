"""The figure of docs/fairway.md, for `python docs/make_figures.py fairway`."""

from __future__ import annotations

import numpy as np
import shapely
from make_figures import LAKE, REGION, WATER, fill, frame_axes, legend, line_key, lines, save, sheet
from make_survey_figure import ways_m

from mrmission.cli.areas import read_area
from mrmission.options import PlanOptions
from mrmission.pipeline import plan
from mrmission.report.colours import robot_colour
from mrmission.tour.path import legs_of

OPTIONS = PlanOptions(robots=12, swath_m=15.0, separation_m=0.0, fence=False)
COLOURS = {"lane": "#6f93a6", "fairway": "#c4161c"}
WORDS = {"lane": "lane", "fairway": "lane of the fairway"}


def draw() -> None:
    """Draw the lanes by what they are for, and some tours; write the figure."""
    result = plan(read_area(LAKE, None, None, None), OPTIONS)
    rows = ways_m(result)
    figure, grid = sheet(1, 2, 3.3)
    for axes in grid[0]:
        fill(axes, result.water_m.simplify(0.7), **WATER)
        fill(axes, result.region_m.simplify(0.7), **REGION)
        frame_axes(axes, None)
    for kind, colour in COLOURS.items():
        ways = [way for line, way in rows if line.kind == kind]
        lines(grid[0, 0], ways, colors=colour, linewidths=0.6)
    there = {line.kind for line, _ in rows}
    far = np.argsort([-float(np.ptp(path.points_m, axis=0).max()) for path in result.paths])[:3]
    for number in sorted(far.tolist()):
        path = result.paths[number]
        lines(grid[0, 1], legs_of(path), colors=robot_colour(number + 1), linewidths=0.7)
    for axes in grid[0]:
        middle = shapely.Point(result.homes_m.mean(axis=0))
        axes.plot([middle.x], [middle.y], marker="o", markersize=4, color="black", zorder=9)
    legend(figure, [line_key(WORDS[k], color=c) for k, c in COLOURS.items() if k in there])
    save(figure, "fairway")
