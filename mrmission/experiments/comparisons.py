"""The tables that set plans beside each other: Table 2, the environments, seconds, run times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mrmission.experiments.environments import Environment, PublishedRow, impossible
from mrmission.experiments.jobs import Result
from mrmission.experiments.readings import DEFAULTS, name_of
from mrmission.experiments.tables import (
    PAPER_TABLE_2,
    ROBOT_SETS,
    ROBOTS,
    Score,
    ScoreReading,
    Table,
    by_distance,
    plan_array,
    score,
)

OURS = "minmax"


def lane_score(maps: Sequence[Result], lanes: Sequence[Result]) -> Score:
    """Return our row of Table 2, read as the others are by default."""
    rows = np.array([result["rows"] for result in lanes], dtype=np.float64)
    chosen = [ROBOTS.index(k) for k in ROBOT_SETS[ScoreReading().robots]]
    whole = np.array([m["tour_costs"]["halves"] for m in maps[: len(lanes)]])
    return Score(
        utilization=float((rows[:, :, 1] / np.array(ROBOTS))[:, chosen].mean()),
        ratio=float((rows[:, :, 0] / whole[:, None])[:, chosen].mean()),
        missed=0.0,
    )


def bound_ratio(maps: Sequence[Result], bounds: Sequence[Result]) -> float:
    """Return the ratio that no sharing of strips can be below, read as the others are."""
    rows = np.array([result["bounds"] for result in bounds], dtype=np.float64)
    chosen = [ROBOTS.index(k) for k in ROBOT_SETS[ScoreReading().robots]]
    whole = np.array([m["tour_costs"]["halves"] for m in maps[: len(bounds)]])
    return float((rows / whole[:, None])[:, chosen].mean())


def table_2(maps: Sequence[Result], lanes: Sequence[Result], bounds: Sequence[Result]) -> Table:
    """Return Table 2: the paper's row, ours by default, the nearest reading, and our planner."""
    usual = ScoreReading()
    rows: list[tuple[str, ...]] = []
    notes = []
    for reading in DEFAULTS:
        planner, name = reading.planner, name_of(reading)
        paper = PAPER_TABLE_2[planner]
        mine = score(maps, name, usual)
        ranked = by_distance(maps, planner)
        nearest = ranked[0]
        complete = next(n for n in ranked if n.score.missed < 1e-9)
        rows.append(
            (
                planner,
                *_pair(*paper),
                *_pair(mine.utilization, mine.ratio),
                f"{mine.distance(paper):.1%}",
                *_pair(nearest.score.utilization, nearest.score.ratio),
                f"{nearest.distance:.1%}",
            )
        )
        notes.append(f"{planner} by default: `{name}`")
        notes.append(
            f"{planner} nearest of {len(ranked)}: `{nearest.name}`, `{nearest.reading}`"
            + _missed(nearest.score)
        )
        if complete is not nearest:
            notes.append(
                f"{planner} nearest that sweeps everything: `{complete.name}`, "
                f"`{complete.reading}`: {complete.score.utilization:.1%}, "
                f"{complete.score.ratio:.3f}, off by {complete.distance:.1%}"
            )
    ours = lane_score(maps, lanes)
    share = float(np.mean([1 / k for k in ROBOT_SETS[usual.robots]]))
    rows.append((OURS, "", "", *_pair(ours.utilization, ours.ratio), "", "", "", ""))
    least = bound_ratio(maps, bounds)
    rows.append(("bound", "", "", "", f"{least:.3f}", "", "", "", ""))
    rows.append(("1/k", "", "", "", f"{share:.3f}", "", "", "", ""))
    return Table(
        title=f"Table 2: utilization and max-cost ratio, {len(maps)} random maps",
        header=(
            "", "paper util.", "paper ratio", "ours util.", "ours ratio", "off by",
            "nearest util.", "nearest ratio", "off by",
        ),
        rows=tuple(rows),
        notes=(
            f"all by default read as `{usual}`; off by: both relative errors, added",
            *notes,
            f"{OURS}: strips of pixels shared out by the lane planner, on {len(lanes)} of the maps",
            "bound: no sharing of strips is below 1/k, nor below the way to the farthest and back",
        ),
    )  # fmt: skip


def _pair(utilization: float, ratio: float) -> tuple[str, str]:
    return f"{utilization:.1%}", f"{ratio:.3f}"


def _missed(row: Score) -> str:
    return f"; it leaves {row.missed:.1%} of the free area to nobody" if row.missed > 1e-9 else ""


def table_2_fresh(maps: Sequence[Result], fresh: Sequence[Result]) -> Table:
    """Return how the rows chosen on some maps do on others."""
    rows = []
    usual = ScoreReading()
    for reading in DEFAULTS:
        planner, name = reading.planner, name_of(reading)
        paper = PAPER_TABLE_2[planner]
        here, there = score(maps, name, usual), score(fresh, name, usual)
        chosen, again = by_distance(maps, planner)[0], by_distance(fresh, planner)
        rank = 1 + [(n.name, n.reading) for n in again].index((chosen.name, chosen.reading))
        rows.append(
            (
                planner,
                f"{here.utilization:.1%} / {here.ratio:.3f}",
                f"{there.utilization:.1%} / {there.ratio:.3f}",
                f"{here.distance(paper):.1%}",
                f"{there.distance(paper):.1%}",
                f"{chosen.distance:.1%}",
                f"{again[rank - 1].distance:.1%}",
                f"{rank} of {len(again)}",
            )
        )
    return Table(
        title=f"Table 2 on fresh seeds: {len(fresh)} other maps",
        header=(
            "", "default", "on fresh", "off by", "on fresh", "nearest, off by", "on fresh",
            "its rank there",
        ),
        rows=tuple(rows),
    )  # fmt: skip


def all_scores(maps: Sequence[Result]) -> Table:
    """Return every reading of every planner and of the score, nearest first."""
    rows = []
    for planner in PAPER_TABLE_2:
        for found in by_distance(maps, planner):
            row = found.score
            rows.append(
                (
                    planner,
                    found.name.partition(" ")[2],
                    found.reading.denominator,
                    found.reading.used,
                    found.reading.robots,
                    f"{row.utilization:.4f}",
                    f"{row.ratio:.4f}",
                    f"{row.missed:.4f}",
                    f"{found.distance:.4f}",
                )
            )
    return Table(
        title="All readings",
        header=(
            "planner", "reading", "denominator", "used", "k", "utilization", "ratio",
            "area left to nobody", "distance to the paper's row",
        ),
        rows=tuple(rows),
    )  # fmt: skip


def figure_4_rows(maps: Sequence[Result], lanes: Sequence[Result]) -> Table:
    """Return utilization and ratio per k, of the default readings and of our planner."""
    whole = np.array([m["tour_costs"]["halves"] for m in maps])
    curves: dict[str, tuple[Any, Any]] = {}
    for reading in DEFAULTS:
        found = plan_array(maps, name_of(reading))
        curves[reading.planner] = (found[:, :, 2], found[:, :, 0] / whole[:, None])
    rows = np.array([result["rows"] for result in lanes], dtype=np.float64)
    curves[OURS] = (rows[:, :, 1], rows[:, :, 0] / whole[: len(lanes), None])
    return Table(
        title="Figure 4: utilization and max-cost ratio over the number of robots",
        header=("planner", "k", "utilization", "ratio", "least ratio", "largest ratio"),
        rows=tuple(
            (
                planner,
                str(k),
                f"{(used[:, i] / k).mean():.4f}",
                f"{ratio[:, i].mean():.4f}",
                f"{ratio[:, i].min():.4f}",
                f"{ratio[:, i].max():.4f}",
            )
            for planner, (used, ratio) in curves.items()
            for i, k in enumerate(ROBOTS)
        ),
    )


def environment_table(
    environment: Environment, plans: Result, lanes: Result
) -> tuple[Table, list[str]]:
    """Return ours beside theirs for every planner and k, and what of theirs cannot be."""
    free = plans["graph"]["free_px"]
    rows = []
    wrong: list[str] = []
    for reading in DEFAULTS:
        theirs = environment.published.get(reading.planner)
        ours = plans["plans"][name_of(reading)]
        for i, k in enumerate(ROBOTS):
            cost, tours = ours[i][0], int(ours[i][1])
            row = [reading.planner, str(k), f"{cost:,.0f}", f"{cost / (free / k):.3f}", str(tours)]
            if theirs is not None and k in theirs.robots:
                at = theirs.robots.index(k)
                other = theirs.max_cost[at]
                impossible_here = other < free / k
                row += [
                    f"{other:,.0f}" + ("*" if impossible_here else ""),
                    f"{other / (free / k):.3f}",
                    str(theirs.tours[at]),
                    f"{cost / other - 1:+.1%}",
                ]
            else:
                row += ["", "", "", ""]
            rows.append(tuple(row))
        if theirs is not None:
            wrong += [f"{environment.name}: {t}" for t in impossible(theirs, free, reading.planner)]
    for i, k in enumerate(ROBOTS):
        cost, tours = lanes["rows"][i]
        rows.append(
            (OURS, str(k), f"{cost:,.0f}", f"{cost / (free / k):.3f}", str(tours), "", "", "", "")
        )
    graph = plans["graph"]
    cells = sorted({row.cells for row in environment.published.values()})
    notes = [
        f"{free:,.0f} free pixels, {graph['edges']:.0f} cells, tour of {graph['tour_length']:.0f} "
        "edges" + (f" (the authors': {', '.join(map(str, cells))})" if cells else "")
    ]
    if wrong:
        notes.append("* below the free area over k, which no complete plan can be")
    table = Table(
        title=f"{environment.name}: maximum cost per number of robots",
        header=(
            "planner", "k", "ours", "over free/k", "tours", "theirs", "over free/k", "tours",
            "ours to theirs",
        ),
        rows=tuple(rows),
        notes=tuple(notes),
    )  # fmt: skip
    return table, wrong


def published_table(items: Sequence[tuple[Environment, Result]]) -> Table:
    """Return how near each planner comes to the authors' maxima, by default and at best.

    The errors are of the maximum cost for every environment and k above 1, relative to theirs.
    """
    rows = []
    notes = []
    for reading in DEFAULTS:
        planner = reading.planner
        known = [(e.published[planner], plans) for e, plans in items if planner in e.published]
        if not known:
            continue
        ranked = sorted(
            (_errors(known, name), name) for name in known[0][1]["plans"] if _is_of(name, planner)
        )
        names = [name for _, name in ranked]
        default, nearest = name_of(reading), names[0]
        rank = names.index(default)
        (off, most, same, count), (best, best_most, best_same, _) = ranked[rank][0], ranked[0][0]
        rows.append(
            (
                planner,
                f"{off:.1%}",
                f"{most:.1%}",
                f"{same} of {count}",
                f"{rank + 1} of {len(ranked)}",
                f"{best:.1%}",
                f"{best_most:.1%}",
                f"{best_same} of {count}",
            )
        )
        notes.append(f"{planner} nearest: `{nearest}`")
    return Table(
        title="How near the readings come to the authors' published maxima",
        header=(
            "planner", "default, mean error", "largest", "same number of tours", "its rank",
            "nearest, mean error", "largest", "same number of tours",
        ),
        rows=tuple(rows),
        notes=tuple(notes),
    )  # fmt: skip


def _is_of(name: str, planner: str) -> bool:
    return name.split()[0] == planner


def _errors(
    known: Sequence[tuple[PublishedRow, Result]], name: str
) -> tuple[float, float, int, int]:
    """Return mean and largest relative error of the maxima, how often the tours are as many."""
    errors, same = [], 0
    for row, plans in known:
        for k, cost, tours in zip(row.robots, row.max_cost, row.tours, strict=True):
            if k == 1 or k not in ROBOTS:
                continue
            mine = plans["plans"][name][ROBOTS.index(k)]
            errors.append(abs(mine[0] / cost - 1))
            same += int(mine[1]) == tours
    return float(np.mean(errors)), max(errors), same, len(errors)


def balance_table(
    items: Sequence[tuple[Environment, Result, Result]],
) -> Table:
    """Return how far the longest tour is above an equal share: the paper's open problem."""
    rows = []
    for environment, plans, lanes in items:
        free = plans["graph"]["free_px"]
        for i, k in enumerate(ROBOTS):
            if k == 1:
                continue
            best = min(plans["plans"][name_of(r)][i][0] for r in DEFAULTS)
            theirs = [
                row.max_cost[row.robots.index(k)]
                for row in environment.published.values()
                if k in row.robots and row.max_cost[row.robots.index(k)] >= free / k
            ]
            mine = lanes["rows"][i][0]
            over, rest = best - free / k, mine - free / k
            rows.append(
                (
                    environment.name,
                    str(k),
                    f"{min(theirs) / (free / k) - 1:.1%}" if theirs else "",
                    f"{best / (free / k) - 1:.1%}",
                    f"{mine / (free / k) - 1:.1%}",
                    f"{1 - rest / over:.1%}" if over > 0 else "",
                )
            )
    return Table(
        title="How far the longest tour is above the free area over k",
        header=("map", "k", "best of theirs", "best of the four, ours", OURS, "gone"),
        rows=tuple(rows),
        notes=(
            "best of theirs: of the published maxima that are possible",
            (
                f"gone: the share of what the best of our four is above the area over k that {OURS}"
                " does without"
            ),
        ),
    )


def seconds_table(jobs: Sequence[Mapping[str, Any]], results: Sequence[Result]) -> Table:
    """Return plans in seconds, as boats would sail them."""
    rows = []
    for job, found in zip(jobs, results, strict=True):
        rows.append(
            (
                job["name"],
                job["method"],
                str(job["robots"]),
                f"{found['makespan_s'] / 60:.1f}",
                f"{found['lower_bound_s'] / 60:.1f}",
                f"{found['lanes_bound_s'] / 60:.1f}" if found["lanes_bound_s"] else "",
                f"{found['utilization']:.0%}",
            )
        )
    return Table(
        title="The same planners in seconds",
        notes=(
            "bound: for any plan whatever; these lanes: for all plans that sweep the same lanes",
        ),
        header=("map", "planner", "k", "longest, min", "bound, min", "these lanes, min", "used"),
        rows=tuple(rows),
    )


def driven_table(jobs: Sequence[Mapping[str, Any]], results: Sequence[Result]) -> Table:
    """Return what simulated boats drove of the plans."""
    rows = []
    for job, found in zip(jobs, results, strict=True):
        planned, driven = np.array(found["planned_s"]), np.array(found["driven_s"])
        lost = found["home"].count(False)
        rows.append(
            (
                job["name"],
                job["method"],
                str(job["robots"]),
                f"{found['planned_makespan_s'] / 60:.1f}",
                f"{lost} not home" if lost else f"{found['driven_makespan_s'] / 60:.1f}",
                (
                    ""
                    if lost
                    else f"{found['driven_makespan_s'] / found['planned_makespan_s'] - 1:+.1%}"
                ),
                "" if lost else f"{np.abs(driven / planned - 1).max():.1%}",
                f"{found['planned_coverage']:.2%}",
                f"{found['driven_coverage']:.2%}",
                f"{found['cross_track_p95_m']:.2f}",
            )
        )
    return Table(
        title="Planned and driven: simulated boats",
        header=(
            "map", "planner", "k", "planned, min", "driven, min", "off by", "worst robot off by",
            "planned coverage", "driven coverage", "p95 off the lanes, m",
        ),
        rows=tuple(rows),
    )  # fmt: skip


ORDERS = {
    "decomposition": "O(pixels)",
    "ECC": "O(edges³)",
    "CRC": "O(k·edges)",
    "CAC": "O(k·edges²)",
    "NRC": "O(edges)",
    "FHK": "O(k·edges)",
    "strips and ways": "",
    OURS: "O(steps)",
}
"""Of the algorithms that the paper builds on, with a dense matching for ECC; ours by design."""


def complexity_table(results: Sequence[Result]) -> Table:
    """Return run times against the size, and the exponent that fits them."""
    edges = np.array([found["graph"]["edges"] for found in results], dtype=np.float64)
    pixels = np.array([found["pixels"] for found in results], dtype=np.float64)
    rows = []
    for stage, order in ORDERS.items():
        seconds = np.array([found["seconds"][stage] for found in results])
        size = pixels if stage == "decomposition" else edges
        exponent = float(np.polyfit(np.log(size), np.log(seconds), 1)[0]) if len(size) > 1 else 0.0
        rows.append(
            (
                stage,
                order,
                "pixels" if stage == "decomposition" else "edges",
                f"{exponent:.2f}",
                *(f"{s * 1000:.2f}" for s in seconds),
            )
        )
    return Table(
        title="Run time of each stage, processor ms",
        header=(
            "stage", "order", "n", "measured exponent",
            *(f"{e:,.0f} edges, {p:,.0f} px" for e, p in zip(edges, pixels, strict=True)),
        ),
        rows=tuple(rows),
        notes=(
            f"{OURS} searches a fixed number of steps, so its time is a setting",
            "strips and ways: the matrix of in-water ways between all ends of the strips",
        ),
    )  # fmt: skip
