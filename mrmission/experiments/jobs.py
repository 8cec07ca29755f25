"""Jobs of the study: each a plain argument to a plain result, remembered in files, run anywhere.

A result depends on its argument alone, so the numbers are the same whatever runs the jobs, and a
study that was interrupted goes on where it stopped.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import mrmission
from mrmission.errors import ConfigError
from mrmission.mission.files import write_whole

Job = dict[str, Any]
"""Plain values, as JSON has them."""
Result = dict[str, Any]
Work = Callable[[Job], Result]

CONNECT_S = 10
PARENT_CHECK_S = 2
FORMAT = 1
"""Part of every file name: raised when results remembered before would be wrong now."""


def remembered_as(work: Work, job: Job) -> str:
    """Return the file name of a job's result: its function, and a hash of all it depends on."""
    key = json.dumps([FORMAT, mrmission.__version__, work.__name__, job], sort_keys=True)
    return f"{work.__name__}-{hashlib.sha256(key.encode()).hexdigest()[:24]}.json"


def run_jobs(
    work: Work,
    jobs: Sequence[Job],
    *,
    cache: Path | None = None,
    processes: int = 1,
    scheduler: str | None = None,
    on_done: Callable[[], None] = lambda: None,
) -> list[Result]:
    """Return the results of all jobs, in their order.

    Parameters
    ----------
    work
        A function of a module, so that other processes find it.
    jobs
        Its arguments.
    cache
        Folder of the results found before, and of those found now; None remembers nothing.
    processes
        How many processes work at once; 1 works in this one.
    scheduler
        Address of a Dask scheduler whose workers take the jobs instead.
    on_done
        Called after each job.

    Raises
    ------
    ConfigError
        When there is no such scheduler, or Dask is not installed.
    """
    results: list[Result | None] = [_recall(cache, work, job) for job in jobs]
    todo = [i for i, result in enumerate(results) if result is None]
    for _ in range(len(jobs) - len(todo)):
        on_done()
    for i, result in _finished(work, jobs, todo, processes, scheduler):
        # through text, so that a result is the same whether it was remembered or not
        text = json.dumps(result, sort_keys=True)
        if cache is not None:
            cache.mkdir(parents=True, exist_ok=True)
            write_whole(cache / remembered_as(work, jobs[i]), text, overwrite=True)
        results[i] = json.loads(text)
        on_done()
    return [result for result in results if result is not None]


def _recall(cache: Path | None, work: Work, job: Job) -> Result | None:
    if cache is None:
        return None
    try:
        found = json.loads((cache / remembered_as(work, job)).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) else None


def _finished(
    work: Work, jobs: Sequence[Job], todo: Sequence[int], processes: int, scheduler: str | None
) -> Iterator[tuple[int, Result]]:
    """Yield the index and the result of each job as it is done."""
    if scheduler is not None and todo:
        yield from _on_dask(work, jobs, todo, scheduler)
    elif processes == 1 or len(todo) < 2:
        for i in todo:
            yield i, work(jobs[i])
    else:
        # spawned, not forked: a child shares no threads and no state with this process
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(
            min(processes, len(todo)),
            mp_context=context,
            initializer=_leave_with,
            initargs=(os.getpid(),),
        ) as pool:
            waiting = {pool.submit(work, jobs[i]): i for i in todo}
            try:
                for future in as_completed(waiting):
                    yield waiting[future], future.result()
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise


def _leave_with(parent: int) -> None:
    """End this process when the one that started it is gone, killed and unable to say so."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _on_dask(
    work: Work, jobs: Sequence[Job], todo: Sequence[int], scheduler: str
) -> Iterator[tuple[int, Result]]:
    try:
        from distributed import Client
        from distributed import as_completed as dask_completed
    except ImportError:
        raise ConfigError(
            "--scheduler: Dask is not installed; install mrmission[dask], or leave --scheduler out"
        ) from None
    try:
        client = Client(scheduler, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"--scheduler {scheduler}: no scheduler answers there ({error}); name its address, "
            "such as tcp://host:8786"
        ) from None
    with client:
        futures = {client.submit(work, jobs[i], pure=False): i for i in todo}
        for future in dask_completed(list(futures)):
            yield futures[future], future.result()
