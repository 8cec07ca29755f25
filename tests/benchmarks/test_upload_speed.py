"""Upload and read-back of 200 items each: 32 simulated boats on one machine against one.

Wall time, because waiting for answers is what an upload does; the boats run in a process of their
own, so that the two do not share one interpreter.
"""

from __future__ import annotations

import asyncio
import json
import subprocess
import sys
import time

import numpy as np

from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint
from mrmission.vehicle.upload import upload_fleet

ITEMS = 200
BOATS = 32
PASS_ITEMS = 2_000_000


def mission(robot: int, shift: int) -> Mission:
    return Mission(
        robot=robot,
        sortie=1,
        vehicle="boat",
        items=tuple(
            MissionItem(
                seq=seq, frame=3, command=16, current=int(seq == 0), autocontinue=1, param1=0.0,
                param2=0.0, param3=0.0, param4=0.0, x=340_600_000 + 90 * seq + shift,
                y=-812_500_000 + robot, z=0.0,
            )
            for seq in range(ITEMS)
        ),
        fence=(
            FencePolygon(
                inclusion=True,
                points_e7=np.array(
                    [[340_000_000, -813_000_000], [341_000_000, -813_000_000], [341_000_000, 0]]
                ),
            ),
        ),
        rally=(RallyPoint(lat_e7=340_600_000, lon_e7=-812_500_000),),
    )  # fmt: skip


def upload_s(links: list[str], shift: int) -> float:
    """Return the wall time of discovery, upload and read-back."""
    given = [mission(robot, shift) for robot in range(1, len(links) + 1)]
    start = time.perf_counter()
    rows = asyncio.run(upload_fleet(given, links))
    elapsed = time.perf_counter() - start
    assert all(row.status == "verified" for row in rows), rows
    return elapsed


def test_32_boats_take_a_few_times_as_long_as_one() -> None:
    command = [sys.executable, "-m", "mrmission.cli.main", "sim", "--k", str(BOATS), "--json"]
    with subprocess.Popen(
        [*command, "--base-port", "0"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        try:
            assert process.stdout is not None
            links = [b["link"] for b in json.loads(process.stdout.readline())["boats"]]
            one_s = upload_s(links[:1], shift=1)
            all_s = upload_s(links, shift=2)
        finally:
            process.terminate()
    data = np.ones(PASS_ITEMS)
    start = time.process_time()
    for _ in range(50):
        data.sum()
    pass_s = (time.process_time() - start) / 50
    print(  # noqa: T201
        f"\nupload and read-back of {ITEMS} items: k = 1 {one_s:.2f} s, k = {BOATS} {all_s:.2f} s, "
        f"ratio {all_s / one_s:.1f}; one numpy pass over {PASS_ITEMS:,} numbers {pass_s * 1e3:.2f} "
        f"ms, ratio of k = {BOATS} to it {all_s / pass_s:.0f}"
    )
    # Sent one after another, 32 boats would take 32 times as long.
    assert all_s < 16 * one_s
