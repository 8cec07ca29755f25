"""The figures of the study: figure 4, 5 and 6 as the paper has them, and run times."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mrmission.errors import ConfigError
from mrmission.experiments.regions import Owners
from mrmission.model import BoolArray
from mrmission.report.colours import robot_colour

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MARKS = {"CRC": "o-", "CAC": "s-", "NRC": "^-", "FHK": "v-", "minmax": "D-"}
COLOURS = {
    "CRC": "#005ab4", "CAC": "#c34b00", "NRC": "#787878", "FHK": "#8c3ca5", "minmax": "#007846",
}  # fmt: skip
OTHER_COLOURS = ("#000000", "#b48c00", "#009696", "#c832a0")
FORMATS = ("svg", "png")
DPI = 150
_STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "svg.hashsalt": "mrmission",
    "svg.fonttype": "none",
}


def render(figure: Figure) -> dict[str, bytes]:
    """Return the figure's bytes in each of :data:`FORMATS`: the same for the same figure."""
    import matplotlib as mpl

    out = {}
    for suffix in FORMATS:
        buffer = io.BytesIO()
        metadata = {"Date": None, "Creator": "mrmission"} if suffix == "svg" else {"Software": None}
        with mpl.rc_context(_STYLE):
            figure.savefig(buffer, format=suffix, dpi=DPI, metadata=metadata)
        out[suffix] = buffer.getvalue()
    return out


def _figure(width_in: float, height_in: float, columns: int = 1) -> tuple[Figure, list[Any]]:
    try:
        import matplotlib as mpl
        from matplotlib.figure import Figure
    except ImportError:
        raise ConfigError(
            "the figures of the study need matplotlib; install mrmission[figure]"
        ) from None
    with mpl.rc_context(_STYLE):
        figure = Figure(figsize=(width_in, height_in), layout="constrained")
        axes = figure.subplots(1, columns, squeeze=False)[0]
    return figure, list(axes)


def figure_4(rows: Sequence[Sequence[str]], paper: Mapping[str, tuple[float, float]]) -> Figure:
    """Draw utilization and max-cost ratio over the number of robots.

    `rows` are those of :func:`mrmission.experiments.comparisons.figure_4_rows`; the paper's means
    are ticks at the right.
    """
    figure, (left, right) = _figure(7.2, 3.0, 2)
    for planner, mark in MARKS.items():
        mine = [row for row in rows if row[0] == planner]
        k = [int(row[1]) for row in mine]
        style = {"color": COLOURS[planner], "label": planner, "markersize": 4, "linewidth": 1.1}
        left.plot(k, [100 * float(row[2]) for row in mine], mark, **style)
        right.plot(k, [float(row[3]) for row in mine], mark, **style)
        if planner in paper:
            utilization, ratio = paper[planner]
            left.plot([34], [100 * utilization], "<", color=COLOURS[planner], markersize=5)
            right.plot([34], [ratio], "<", color=COLOURS[planner], markersize=5)
    k = sorted({int(row[1]) for row in rows})
    right.plot(k, [1 / n for n in k], ":", color="black", linewidth=0.9, label="1/k")
    left.set_ylabel("robots with work, %")
    right.set_ylabel("maximum cost / cost of the single tour")
    right.set_yscale("log")
    for axes in (left, right):
        axes.set_xlabel("robots  (◂ the paper's mean over k)")
        axes.set_xticks(k)
        axes.grid(linewidth=0.3)
    right.legend(fontsize=7)
    return figure


def figure_5(panels: Sequence[tuple[str, Owners]]) -> Figure:
    """Draw who sweeps what, one panel per plan: obstacles black, a colour for each robot."""
    from matplotlib.colors import ListedColormap

    shape = panels[0][1].shape
    width = 3.4
    figure, axes = _figure(width * len(panels), width * shape[1] / shape[0] + 0.3, len(panels))
    most = max(int(owners.max(initial=0)) for _, owners in panels)
    colours = ["#000000", "#ffffff", *(robot_colour(r) for r in range(1, most + 1))]
    for axis, (title, owners) in zip(axes, panels, strict=True):
        axis.imshow(
            owners.T + 1,
            origin="lower",
            cmap=ListedColormap(colours),
            vmin=-0.5,
            vmax=len(colours) - 0.5,
            interpolation="nearest",
        )
        axis.set_title(title, fontsize=8)
        axis.set_axis_off()
    return figure


def map_sheet(maps: Sequence[BoolArray], rows: int = 2) -> Figure:
    """Draw maps on one sheet at one scale, obstacles black."""
    columns = -(-len(maps) // rows)
    width = max(free.shape[0] for free in maps) + 6
    height = max(free.shape[1] for free in maps) + 6
    sheet = np.full((rows * height, columns * width), 1.0)
    for i, free in enumerate(maps):
        x, y = (i % columns) * width + 3, (rows - 1 - i // columns) * height + 3
        sheet[y - 1 : y + free.shape[1] + 1, x - 1 : x + free.shape[0] + 1] = 0.6
        sheet[y : y + free.shape[1], x : x + free.shape[0]] = free.T
    figure, (axis,) = _figure(7.2, 7.2 * sheet.shape[0] / sheet.shape[1])
    axis.imshow(sheet, origin="lower", cmap="gray", vmin=0, vmax=1, interpolation="nearest")
    axis.set_axis_off()
    return figure


Curve = tuple[Sequence[int], Sequence[float]]


def figure_6(panels: Sequence[tuple[str, Mapping[str, Curve], Mapping[str, Curve]]]) -> Figure:
    """Draw the maximum cost over the number of robots, one panel per environment.

    A panel is its title, our curves and theirs (dashed), by planner.
    """
    figure, axes = _figure(2.6 * len(panels), 2.7, len(panels))
    for axis, (title, ours, theirs) in zip(axes, panels, strict=True):
        for planner, (k, cost) in ours.items():
            axis.plot(
                k, cost, MARKS[planner], color=COLOURS[planner], markersize=3, linewidth=1,
                label=planner,
            )  # fmt: skip
        for planner, (k, cost) in theirs.items():
            axis.plot(k, cost, "--", color=COLOURS[planner], linewidth=1, alpha=0.7)
        axis.set_title(title, fontsize=8)
        axis.set_xlabel("robots")
        axis.set_yscale("log")
        axis.set_xticks([1, 4, 8, 16, 20, 32])
        axis.grid(linewidth=0.3)
    axes[0].set_ylabel("maximum cost, px")
    axes[0].legend(fontsize=6)
    return figure


def run_times(results: Sequence[Mapping[str, Any]], stages: Sequence[str]) -> Figure:
    """Draw the run time of each stage over the number of cells, both logarithmic."""
    figure, (axis,) = _figure(4.2, 3.2)
    edges = [found["graph"]["edges"] for found in results]
    for i, stage in enumerate(stages):
        axis.plot(
            edges,
            [1000 * found["seconds"][stage] for found in results],
            "o-",
            color=COLOURS.get(stage, OTHER_COLOURS[i % len(OTHER_COLOURS)]),
            markersize=3,
            linewidth=1,
            label=stage,
        )
    span = np.array([min(edges), max(edges)], dtype=np.float64)
    for power, style in ((1, ":"), (3, "--")):
        axis.plot(span, 0.05 * (span / span[0]) ** power, style, color="grey", linewidth=0.8)
        axis.annotate(
            f"n{'³' if power == 3 else ''}", (span[1], 0.05 * (span[1] / span[0]) ** power),
            fontsize=7, color="grey",
        )  # fmt: skip
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_xlabel("cells")
    axis.set_ylabel("processor ms")
    axis.grid(linewidth=0.3)
    axis.legend(fontsize=6)
    return figure
