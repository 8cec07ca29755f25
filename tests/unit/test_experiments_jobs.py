"""Jobs of the study: remembered, resumed, the same numbers whoever runs them."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from mrmission.errors import ConfigError
from mrmission.experiments import jobs as jobs_module
from mrmission.experiments.jobs import Job, Result, remembered_as, run_jobs
from mrmission.experiments.readings import DEFAULTS, name_of
from mrmission.experiments.steps import paper_plans

JOBS: list[Job] = [
    {"seed": 3, "number": n, "readings": [name_of(r) for r in DEFAULTS], "robots": [2, 8]}
    for n in range(3)
]
CALLS: list[int] = []


def double(job: Job) -> Result:
    CALLS.append(job["n"])
    if job["n"] == 13:
        raise RuntimeError("broken off")
    return {"twice": 2 * job["n"], "third": job["n"] / 3}


def test_results_come_in_the_order_of_the_jobs_and_each_is_counted() -> None:
    done: list[None] = []
    found = run_jobs(double, [{"n": 5}, {"n": 4}], on_done=lambda: done.append(None))
    assert [r["twice"] for r in found] == [10, 8]
    assert len(done) == 2


def test_what_was_found_before_is_not_done_again(tmp_path: Path) -> None:
    CALLS.clear()
    jobs = [{"n": n} for n in (1, 2, 13, 4)]
    with pytest.raises(RuntimeError, match="broken off"):
        run_jobs(double, jobs, cache=tmp_path)
    assert CALLS == [1, 2, 13]
    CALLS.clear()
    jobs[2] = {"n": 14}
    first = run_jobs(double, jobs, cache=tmp_path)
    assert CALLS == [14, 4]
    CALLS.clear()
    assert run_jobs(double, jobs, cache=tmp_path) == first
    assert CALLS == []


@pytest.mark.parametrize("text", ["", "{", "[1]", '"x"'])
def test_a_spoilt_file_is_made_anew(tmp_path: Path, text: str) -> None:
    path = tmp_path / remembered_as(double, {"n": 6})
    path.write_text(text)
    assert run_jobs(double, [{"n": 6}], cache=tmp_path) == [{"twice": 12, "third": 2.0}]
    assert json.loads(path.read_text())["twice"] == 12


def test_every_part_of_a_job_is_in_its_name() -> None:
    names = {remembered_as(paper_plans, job) for job in JOBS}
    names |= {remembered_as(double, JOBS[0]), remembered_as(paper_plans, {**JOBS[0], "seed": 4})}
    assert len(names) == 5
    turned = dict(reversed(JOBS[0].items()))
    assert remembered_as(paper_plans, turned) == remembered_as(paper_plans, JOBS[0])


@pytest.mark.slow
def test_the_same_numbers_whatever_the_number_of_processes(tmp_path: Path) -> None:
    alone = run_jobs(paper_plans, JOBS)
    assert run_jobs(paper_plans, JOBS, cache=tmp_path, processes=2) == alone
    assert len(list(tmp_path.iterdir())) == len(JOBS)


def test_a_scheduler_that_is_not_there_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs_module, "CONNECT_S", 0.3)
    if importlib.util.find_spec("distributed") is None:
        with pytest.raises(ConfigError, match=r"install mrmission\[dask\]"):
            run_jobs(double, [{"n": 1}], scheduler="tcp://127.0.0.1:1")
    else:
        with pytest.raises(ConfigError, match=r"tcp://127.0.0.1:1: no scheduler answers"):
            run_jobs(double, [{"n": 1}], scheduler="tcp://127.0.0.1:1")


@pytest.mark.slow
@pytest.mark.filterwarnings("default")
def test_the_same_numbers_on_dask() -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
    ) as cluster:
        found = run_jobs(paper_plans, JOBS, scheduler=cluster.scheduler_address)
    assert found == run_jobs(paper_plans, JOBS)
