"""Random maps and environments of the study."""

from __future__ import annotations

import json
from pathlib import Path

import networkx as nx
import numpy as np
import pytest

from mrmission.errors import InputError
from mrmission.experiments.driven import save_map
from mrmission.experiments.environments import (
    OWN,
    PublishedRow,
    draw_environment,
    environments,
    free_pixels,
    impossible,
)
from mrmission.experiments.random_maps import RandomMapOptions, largest_part, random_map
from mrmission.experiments.world import paper_world


def parts_of(free: np.ndarray) -> list[set[tuple[int, int]]]:
    """4-connected parts, by networkx."""
    graph = nx.grid_2d_graph(*free.shape)
    graph.remove_nodes_from([tuple(p) for p in np.argwhere(~free).tolist()])
    return list(nx.connected_components(graph))


def test_a_map_is_the_same_every_time_and_unlike_the_next() -> None:
    first = random_map(5, 3)
    assert (first == random_map(5, 3)).all()
    assert first.shape != random_map(5, 4).shape or (first != random_map(5, 4)).any()
    assert first.shape != random_map(6, 3).shape or (first != random_map(6, 3)).any()


@pytest.mark.parametrize("number", range(4))
def test_a_map_is_one_4_connected_part(number: int) -> None:
    assert len(parts_of(random_map(1, number))) == 1


def test_obstacles_of_the_map_are_on_the_lattice() -> None:
    options = RandomMapOptions(column_pitch_px=(5, 5), row_pitch_px=(3, 3))
    free = random_map(1, 0, options)
    coarse = free[::5, ::3]
    assert (np.kron(coarse, np.ones((5, 3), dtype=bool)) == free).all()


@pytest.mark.parametrize("seed", range(6))
def test_largest_part_is_the_largest(seed: int) -> None:
    free = np.random.default_rng(seed).random((9, 7)) < 0.55
    largest = max(parts_of(free), key=len)
    found = {tuple(p) for p in np.argwhere(largest_part(free)).tolist()}
    assert len(found) == len(largest)
    assert found in parts_of(free)


def test_the_graphs_are_like_the_papers_table_1() -> None:
    """Means within a fifth of the printed ones: what the generator is tuned for."""
    figures = []
    for number in range(60):
        world = paper_world(random_map(1, number))
        reeb = world.decomposition.reeb
        tour = world.problem.step_costs(world.tour).sum()
        figures.append((len(reeb.node_m), len(reeb.tail), len(world.tour.edge), tour))
    mean = np.mean(figures, axis=0)
    assert mean == pytest.approx([25, 35, 43, 5123], rel=0.2)


def test_own_environments_are_drawn_connected() -> None:
    for name in OWN:
        free = free_pixels(f"own:{name}")
        assert free.shape == draw_environment(name).shape
        assert 0.5 < free.mean() < 1.0
        world = paper_world(free)
        assert len(world.problem.components(np.arange(len(world.problem.cell_cost)))) == 1
    assert [e.source for e in environments(None)] == [f"own:{name}" for name in OWN]


def test_a_folder_of_maps_with_published_figures(tmp_path: Path) -> None:
    free = random_map(2, 0)
    save_map(free, tmp_path / "small.png")
    row = {"k": [1, 2], "max_cost": [900.0, 500.0], "tours": [1, 2], "cells": 7}
    (tmp_path / "published_results.json").write_text(
        json.dumps({"results": {"small.png": {"CRC": row}}})
    )
    (found,) = environments(tmp_path)
    assert found.name == "small"
    assert found.published["CRC"].max_cost == (900.0, 500.0)
    assert (free_pixels(found.source) == free).all()


def test_broken_figures_and_an_empty_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no PNG"):
        environments(tmp_path)
    save_map(random_map(2, 0), tmp_path / "small.png")
    (tmp_path / "published_results.json").write_text('{"results": {"small.png": {"CRC": {}}}}')
    with pytest.raises(InputError, match=r"published_results\.json"):
        environments(tmp_path)


def test_what_cannot_be_is_named() -> None:
    row = PublishedRow(robots=(1, 2, 4), max_cost=(1000.0, 499.0, 300.0), tours=(1, 2, 4), cells=9)
    assert impossible(row, 1000.0, "CAC") == [
        "CAC a maximum of 499 at k = 2 is below the free area over k, 500, by 0.2%"
    ]
    assert len(impossible(row, 1001.0)) == 2
    assert impossible(row, 998.0) == []
