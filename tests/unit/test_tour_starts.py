"""Which tour leaves from which start, against every permutation."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from mrmission.tour.starts import bottleneck_assignment


def test_the_bottleneck_is_the_least_of_all_permutations() -> None:
    rng = np.random.default_rng(1)
    for _ in range(250):
        n = int(rng.integers(1, 6))
        cost = rng.integers(0, 12, (n, n)).astype(float)  # many ties
        got = bottleneck_assignment(cost)
        assert sorted(got.tolist()) == list(range(n))
        best = min(max(cost[i, p[i]] for i in range(n)) for p in permutations(range(n)))
        assert cost[np.arange(n), got].max() == best


def test_large_and_all_equal() -> None:
    assert bottleneck_assignment(np.zeros((60, 60))).tolist() == list(range(60))
    rng = np.random.default_rng(2)
    cost = rng.random((250, 250))
    got = bottleneck_assignment(cost)
    assert sorted(got.tolist()) == list(range(250))
    assert cost[np.arange(250), got].max() < 0.2
    assert np.array_equal(got, bottleneck_assignment(cost))
