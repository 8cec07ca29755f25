"""The split of Frederickson, Hecht and Kim against its text, and against every split."""

from __future__ import annotations

from itertools import combinations_with_replacement, pairwise

import numpy as np
import pytest

from mrmission.partition.split import frederickson_split, longest_round_trip


def literal(w: list[float], d: list[float], k: int) -> list[int]:
    """The text, word by word: w[i] is the step from vertex i to i + 1 of the tour R."""
    c_r = sum(w)
    s_max = 0.5 * max(d[i] + w[i] + d[i + 1] for i in range(len(w)))
    borders = [0]
    for j in range(1, k):
        goal = (j / k) * (c_r - 2 * s_max) + s_max
        v, so_far = 0, 0.0
        while v < len(w) and so_far + w[v] <= goal:
            so_far += w[v]
            v += 1
        r = goal - so_far
        split = v if v == len(w) or r + d[v] <= w[v] - r + d[v + 1] else v + 1
        borders.append(split)
    return [*borders, len(w)]


def metric_tour(rng: np.random.Generator, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """A closed tour of points in the plane with the depot first: costs obey the triangle."""
    points = rng.integers(-20, 21, (steps, 2)).astype(float)
    points = np.vstack([points, points[:1]])
    distance = np.hypot(*(points - points[0]).T)
    # a step costs what it sweeps, which is never less than the way
    w = np.hypot(*np.diff(points, axis=0).T) * rng.uniform(1.0, 3.0, steps)
    return w, distance


def makespan(borders, w: np.ndarray, d: np.ndarray) -> float:
    return max((d[a] + w[a:b].sum() + d[b] if b > a else 0.0) for a, b in pairwise(borders))


@pytest.mark.parametrize("seed", range(5))
def test_split_is_the_text(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(120):
        n = int(rng.integers(1, 25))
        # integers: sums are exact, so ties mean the same on both sides
        w = rng.integers(1, 30, n).astype(float)
        d = rng.integers(0, 8, n + 1).astype(float)
        d[0] = d[-1] = 0
        for k in (1, 2, 3, 4, 7, 12, 40):
            s_max = longest_round_trip(w, d)
            if w.sum() < 2 * s_max:  # outside the theorem: the goals run backwards
                continue
            assert frederickson_split(w, d, k) == literal(w.tolist(), d.tolist(), k)


def test_borders_rise_whatever_the_costs() -> None:
    rng = np.random.default_rng(7)
    for _ in range(300):
        n = int(rng.integers(0, 12))
        w, d = rng.uniform(0, 5, n), rng.uniform(0, 50, n + 1)
        for k in (1, 2, 5, 30):
            borders = frederickson_split(w, d, k)
            assert len(borders) == k + 1
            assert borders[0] == 0
            assert borders[-1] == n
            assert borders == sorted(borders)


def test_the_bound_of_the_proof_holds() -> None:
    # closed pieces: no longer than (c(R) - 2 s_max) / k + 2 s_max
    rng = np.random.default_rng(8)
    for _ in range(300):
        w, d = metric_tour(rng, int(rng.integers(3, 14)))
        s_max = longest_round_trip(w, d)
        for k in (1, 2, 3, 4, 6):
            limit = (w.sum() - 2 * s_max) / k + 2 * s_max
            assert makespan(frederickson_split(w, d, k), w, d) <= limit + 1e-9


def test_within_two_minus_one_k_of_the_best_cut_of_the_tour() -> None:
    # every plan sweeps all steps, and one robot makes the costliest single trip: with a tour
    # no longer than the optimum of one robot the theorem's factor is 2 - 1/k
    rng = np.random.default_rng(9)
    for _ in range(60):
        n = int(rng.integers(3, 9))
        w, d = metric_tour(rng, n)
        for k in (2, 3, 4):
            best = min(
                makespan((0, *cut, n), w, d)
                for cut in combinations_with_replacement(range(n + 1), k - 1)
            )
            got = makespan(frederickson_split(w, d, k), w, d)
            assert best - 1e-9 <= got <= (2 - 1 / k) * best + 1e-9
