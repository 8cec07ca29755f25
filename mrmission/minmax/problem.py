"""What the search is told, and what it answers: :class:`LaneProblem` and :class:`LaneTours`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from mrmission.minmax.travel import Arrays, Float, Int, Price, travel_s
from mrmission.model import FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class SparseWays:
    """Ways between more ends than a matrix can hold, see :func:`mrmission.minmax.travel.travel_s`.

    Attributes
    ----------
    near
        (2 · lines, K) the nearest ends of other lines, nearest first.
    arrays, second_s, price
        ``travel_s(arrays, second_s, price, e, f)`` are the seconds between two ends.
    """

    near: Int
    arrays: Arrays
    second_s: Float
    price: Price


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneProblem:
    """Lines with two ends each; end ``2i`` and ``2i + 1`` are the ends of line ``i``.

    Attributes
    ----------
    lane_cost
        (lines,) cost of sweeping each line, for a robot whose scale is 1.
    end_cost
        (2·lines, 2·lines) symmetric cost of travel between ends, for a robot whose scale is 1;
        None where `sparse` says it.
    home_cost
        (robots, 2·lines) cost of travel between each robot's home and the ends; its own.
    sparse
        The cost of travel where no matrix is kept.
    sweep_scale, travel_scale
        (robots,) how many times as much sweeping, and travel between ends, costs a robot; None
        where all are alike.
    kinds
        (robots,) which kind each robot is of: 0 where `lane_cost` and `end_cost` hold, n where
        ``others[n - 1]`` does; None where all are of kind 0.
    others
        (lines,) and (2·lines, 2·lines) what those are for the other kinds, before scales.

    Raises
    ------
    ValueError
        When there is neither a matrix nor its substitute, or several kinds without a matrix.
    """

    lane_cost: FloatArray
    home_cost: FloatArray
    end_cost: FloatArray | None = None
    sparse: SparseWays | None = None
    sweep_scale: FloatArray | None = None
    travel_scale: FloatArray | None = None
    kinds: IntArray | None = None
    others: tuple[tuple[FloatArray, FloatArray], ...] = ()

    def __post_init__(self) -> None:
        if self.end_cost is None and self.sparse is None:
            raise ValueError("ways between ends: neither a matrix nor a table is given")
        if self.end_cost is None and self.others:
            raise ValueError("ways between ends: a table holds for one kind of robot only")

    @property
    def robots(self) -> int:
        """Return the number of robots."""
        return len(self.home_cost)

    def scales(self) -> tuple[FloatArray, FloatArray]:
        """Return (robots,) scales of sweeping and of travel."""
        ones = np.ones(self.robots)
        sweep = ones if self.sweep_scale is None else np.asarray(self.sweep_scale, dtype=float)
        travel = ones if self.travel_scale is None else np.asarray(self.travel_scale, dtype=float)
        return sweep, travel

    def kind_of(self, robot: int) -> int:
        """Return which kind a robot is of."""
        return 0 if self.kinds is None else int(self.kinds[robot])

    def lanes_of(self, kind: int) -> FloatArray:
        """Return (lines,) costs of sweeping for a kind of robot, before scales."""
        return self.others[kind - 1][0] if kind else self.lane_cost

    def dearer(self, more: Sequence[FloatArray | float]) -> LaneProblem:
        """Return the problem with lines that cost each kind more before scales.

        That is (lines,) of `more` for each kind, or as much for each line.
        """
        others = [(lane + m, ends) for (lane, ends), m in zip(self.others, more[1:], strict=True)]
        return replace(self, lane_cost=self.lane_cost + more[0], others=tuple(others))

    def ways(
        self, a: npt.NDArray[np.integer], b: npt.NDArray[np.integer], kind: int = 0
    ) -> FloatArray:
        """Return (n,) costs of travel between pairs of ends for a kind of robot, before scales."""
        if kind:
            return self.others[kind - 1][1][a, b]
        if self.end_cost is not None:
            return self.end_cost[a, b]
        assert self.sparse is not None  # one of both is given
        ways = self.sparse
        return np.array(
            [
                travel_s(ways.arrays, ways.second_s, ways.price, int(e), int(f))
                for e, f in zip(a, b, strict=True)
            ],
            dtype=np.float64,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneTours:
    """Per robot the ends at which lines are entered, in order, and the cost of each tour."""

    entries: tuple[IntArray, ...]
    cost: FloatArray


def tour_cost(problem: LaneProblem, robot: int, entries: npt.NDArray[np.integer]) -> float:
    """Return the cost of one tour from the robot's home over the lines and back."""
    if len(entries) == 0:
        return 0.0
    exits = entries ^ 1
    sweep, travel = problem.scales()
    kind = problem.kind_of(robot)
    return float(
        problem.home_cost[robot, entries[0]]
        + sweep[robot] * problem.lanes_of(kind)[entries >> 1].sum()
        + travel[robot] * problem.ways(exits[:-1], entries[1:], kind).sum()
        + problem.home_cost[robot, exits[-1]]
    )
