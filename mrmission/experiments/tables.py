"""The tables of the study: the paper's numbers, ours, and texts in Markdown and CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mrmission.experiments.jobs import Result

PAPER_TABLE_1 = {
    "vertices": (10, 25, 41),
    "edges": (12, 35, 57),
    "tour_length": (16, 43, 73),
    "tour_cost": (2414, 5123, 11176),
}
"""Least, mean and largest over 200 maps, as printed."""
PAPER_TABLE_2 = {
    "CRC": (0.866, 0.248),
    "CAC": (0.762, 0.245),
    "NRC": (0.520, 0.433),
    "FHK": (0.690, 0.388),
}
"""Utilization and max-cost ratio, mean over k, as printed."""
ROBOTS = (1, 2, 4, 8, 16, 20, 32)
ROBOT_SETS: Mapping[str, tuple[int, ...]] = {
    "table": (2, 4, 8, 16, 20, 32),
    "text": (1, 4, 8, 16, 20, 32),
    "both": ROBOTS,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreReading:
    """How plans become a row of Table 2.

    Attributes
    ----------
    denominator
        The ratio's: the cost of the single-robot ``tour`` c(R), or the ``free`` area.
    used
        A robot counts as used with ``any`` work, or when it ``sweeps`` something for the first
        time: not where all it has are second walks of doubled cells.
    robots
        The sizes of the fleet: those of the ``table``, of the ``text``, or ``both``.
    """

    denominator: Literal["tour", "free"] = "tour"
    used: Literal["sweeps", "any"] = "sweeps"
    robots: Literal["table", "text", "both"] = "table"

    def __str__(self) -> str:
        return f"denominator={self.denominator} used={self.used} k={self.robots}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """One row of Table 2, and the share of the free area that is swept by nobody."""

    utilization: float
    ratio: float
    missed: float

    def distance(self, paper: tuple[float, float]) -> float:
        """Return how far it is from the paper's: both relative errors, added."""
        return abs(self.utilization / paper[0] - 1) + abs(self.ratio / paper[1] - 1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table to write down; cells are texts already."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()

    def markdown(self) -> str:
        """Return the table as Markdown, title first, notes last."""
        lines = [f"## {self.title}", "", _line(self.header), _line(["---"] * len(self.header))]
        lines += [_line(row) for row in self.rows]
        if self.notes:
            lines += ["", *(f"- {note}" for note in self.notes)]
        return "\n".join(lines) + "\n"

    def csv(self) -> str:
        """Return the header and the rows as CSV."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(self.header)
        writer.writerows(self.rows)
        return out.getvalue()


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def plan_array(maps: Sequence[Result], name: str) -> Any:
    """Return (maps, k, 4) maximum cost, robots with work, robots that sweep, area missed."""
    return np.array([m["plans"][name] for m in maps], dtype=np.float64)


def score(
    maps: Sequence[Result],
    name: str,
    reading: ScoreReading,
    robots: Sequence[int] = ROBOTS,
    rows: Any = None,
) -> Score:
    """Return a row of Table 2 for one reading of a planner.

    `rows` may be given by who asks often: :func:`plan_array` of the maps and the name.
    """
    rows = plan_array(maps, name) if rows is None else rows
    chosen = [robots.index(k) for k in ROBOT_SETS[reading.robots] if k in robots]
    if reading.denominator == "tour":
        whole = np.array([m["tour_costs"][_doubled(name)] for m in maps])
    else:
        whole = np.array([m["graph"]["free_px"] for m in maps])
    used = rows[:, :, 1 if reading.used == "any" else 2] / np.array(robots)
    free = np.array([m["graph"]["free_px"] for m in maps])
    return Score(
        utilization=float(used[:, chosen].mean()),
        ratio=float((rows[:, :, 0] / whole[:, None])[:, chosen].mean()),
        missed=float((rows[:, :, 3] / free[:, None])[:, chosen].mean()),
    )


_DENOMINATORS: tuple[Literal["tour", "free"], ...] = ("tour", "free")
_USED: tuple[Literal["sweeps", "any"], ...] = ("sweeps", "any")
_SETS: tuple[Literal["table", "text", "both"], ...] = ("table", "text", "both")


def _doubled(name: str) -> str:
    """Return what a doubled cell pays in a reading; clusters are toured in halves."""
    return dict(part.split("=") for part in name.split()[1:]).get("doubled", "halves")


SCORE_READINGS = tuple(
    ScoreReading(denominator=d, used=u, robots=k)
    for d in _DENOMINATORS
    for u in _USED
    for k in _SETS
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Nearest:
    """A reading of a planner and of the score, and how far its row is from the paper's."""

    name: str
    reading: ScoreReading
    score: Score
    distance: float


def by_distance(maps: Sequence[Result], planner: str) -> list[Nearest]:
    """Return every reading of a planner with every reading of the score, nearest first."""
    names = [name for name in maps[0]["plans"] if name.split()[0] == planner]
    found = []
    for name in names:
        rows = plan_array(maps, name)
        for reading in SCORE_READINGS:
            if reading.denominator == "free" and _doubled(name) == "halves":
                continue  # the tour in halves costs the free area
            row = score(maps, name, reading, rows=rows)
            distance = row.distance(PAPER_TABLE_2[planner])
            found.append(Nearest(name=name, reading=reading, score=row, distance=distance))
    # the first of equals is the one that is nearest to how the other rows are read
    return sorted(found, key=lambda n: (round(n.distance, 9), SCORE_READINGS.index(n.reading)))


def table_1(maps: Sequence[Result]) -> Table:
    """Return our Table 1 beside the paper's."""
    names = {
        "vertices": "vertices of the Reeb graph",
        "edges": "edges of the Reeb graph",
        "tour_length": "length of the Euler tour, edges",
        "tour_cost": "cost of the Euler tour",
    }
    rows = []
    for key, words in names.items():
        values = np.array([m["graph"][key] for m in maps])
        ours = (values.min(), values.mean(), values.max())
        paper = PAPER_TABLE_1[key]
        rows.append(
            (
                words,
                *(f"{v:,.0f}" for v in (ours[0],)),
                f"{ours[1]:,.1f}",
                f"{ours[2]:,.0f}",
                *(f"{v:,}" for v in paper),
                f"{ours[1] / paper[1] - 1:+.1%}",
            )
        )
    odd = np.mean([m["graph"]["odd_vertices"] for m in maps])
    return Table(
        title=f"Table 1: {len(maps)} random maps",
        header=(
            "", "ours least", "mean", "largest", "paper least", "mean", "largest", "mean, off by",
        ),
        rows=tuple(rows),
        notes=(
            (
                f"of our vertices {odd:.1f} have an odd degree on average; each two of them cost "
                "the tour at least one edge more, so that graphs in general position, where all "
                "are odd, have tours of at least edges + vertices/2: 47.5 for the paper's means, "
                "not its 43"
            ),
        ),
    )  # fmt: skip
