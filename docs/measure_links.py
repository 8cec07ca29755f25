"""Upload through bad links, and time uploads on good ones; prints Markdown.

    python docs/measure_links.py loss --engine light --client pymavlink --boats 10
    python docs/measure_links.py loss --engine ardupilot --client mavsdk --losses 10 20
    python docs/measure_links.py speed --engine ardupilot
    python docs/measure_links.py parse

`loss` replaces a mission of 100 items, a fence and two rally points by another, as ``mrmission
upload`` does, 20 times per loss, through a proxy that loses that share of the packets each way and
doubles and delays half as many. Then it looks at every vehicle over the same link without faults.
`speed` uploads and reads back 50, 300 and 600 items, with both clients. `parse` times a second of
telemetry of 32 vehicles. ArduRover runs at its own
pace (speed-up 1); it is taken from ``ARDUROVER`` or ``PATH``.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import statistics
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np

from mrmission.model import FencePolygon, Mission, MissionItem, RallyPoint
from mrmission.simulate import ArdupilotFleet, SimulatedFleet
from mrmission.vehicle.connection import parse_connections
from mrmission.vehicle.framing import Codec, FrameReader, mavlink
from mrmission.vehicle.items import MissionType, RawItem, to_raw
from mrmission.vehicle.links import LinkTimeouts, open_links
from mrmission.vehicle.readback import compare_items
from mrmission.vehicle.rows import Holds, UploadRow
from mrmission.vehicle.upload import upload_fleet

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from lossy_proxy import Badness, LossyTcp

HOME = (8.5, 47.3)
LOSSES = (0, 2, 5, 10, 20)
COUNTS = (50, 300, 600)
PATIENT = LinkTimeouts(discovery_s=20.0, retry_probe_s=10.0)
CLIENTS = {"pymavlink": "own", "mavsdk": "MAVSDK"}
ENGINES = {"light": "light boat", "ardupilot": "ArduRover"}


def mission(robot: int, number: int, count: int = 100) -> Mission:
    """Return a mission of `count` items; each `number` makes another one."""
    lat, lon = round(HOME[1] * 1e7), round(HOME[0] * 1e7)
    items = tuple(
        MissionItem(
            seq=seq, frame=3 if seq else 0, command=16, current=int(seq == 0), autocontinue=1,
            param1=0.0, param2=0.0, param3=0.0, param4=0.0,
            x=lat + 100 * seq + number, y=lon + 50 * seq, z=0.0,
        )
        for seq in range(count)
    )  # fmt: skip
    ring = np.array([lat, lon + number]) + np.array(
        [[-9000, -9000], [90000, -9000], [90000, 90000], [-9000, 90000]]
    )
    return Mission(
        robot=robot,
        sortie=1,
        vehicle="boat",
        items=items,
        fence=(FencePolygon(inclusion=True, points_e7=ring),),
        rally=tuple(RallyPoint(lat_e7=lat + n, lon_e7=lon + number) for n in range(2)),
    )


@contextlib.asynccontextmanager
async def boats(engine: str, count: int) -> AsyncIterator[list[str]]:
    """Yield the links of a fleet."""
    fleet: Any
    if engine == "light":
        fleet = SimulatedFleet(count=count, home_lonlat=HOME, base_port=0)
    else:
        fleet = ArdupilotFleet(count=count, home_lonlat=HOME, base_port=0, speedup=1.0)
    async with fleet:
        yield list(fleet.links)


Stored = dict[MissionType, tuple[RawItem, ...]]


async def stored(link: str) -> Stored:
    """Read what a vehicle holds, over a link without faults."""
    async with open_links(parse_connections([link]), expected=1, timeouts=PATIENT) as found:
        (vehicle,) = found.vehicles.values()
        return {kind: await vehicle.download(kind) for kind in MissionType}


def same(held: Stored, plan: Mission | None) -> bool:
    """Return whether a vehicle holds `plan`, or nothing where that is None."""
    if plan is None:
        return all(len(items) <= (kind == 0) for kind, items in held.items())
    raw = to_raw(plan)
    return all(not compare_items(raw[kind], held[kind], kind) for kind in MissionType)


def truth(row: UploadRow, held: Stored, old: Mission, new: Mission) -> str:
    """Return what became of a try, as the vehicle itself shows it."""
    if row.verified:
        return "verified" if same(held, new) else "WRONG"
    if row.holds in (Holds.UNTOUCHED, Holds.RESTORED):
        return "old" if same(held, old) else "WRONG"
    if row.holds is Holds.EMPTY:
        return "empty" if same(held, None) else "WRONG"
    return "unknown"


async def losses(engine: str, client: str, shares: list[int], tries: int, count: int) -> None:
    """Print a row per loss."""
    say("| link | client | loss | verified | old kept | left empty | not known | wrongly told "
        "| median | longest | tries a mission |")  # fmt: skip
    say("| --- " * 11 + "|")
    async with boats(engine, count) as links:
        held: list[Mission] = [mission(n, 0) for n in range(1, count + 1)]
        await upload_fleet(held, links)
        number = 0
        for share in shares:
            ends: Counter[str] = Counter()
            took_s: list[float] = []
            attempts = 0
            said: Counter[str] = Counter()
            for first in range(0, tries, count):
                number += 1
                robots = list(range(1, 1 + min(count, tries - first)))
                new = [mission(robot, number) for robot in robots]
                async with contextlib.AsyncExitStack() as stack:
                    proxies = [
                        await stack.enter_async_context(
                            LossyTcp(
                                int(links[robot - 1].rpartition(":")[2]),
                                badness(share, number * 100 + robot),
                            )
                        )
                        for robot in robots
                    ]
                    rows = await upload_fleet(
                        new,
                        [proxy.url for proxy in proxies],
                        assignment={robot: robot for robot in robots},
                        client=client,
                    )
                for row, plan in zip(rows, new, strict=True):
                    now = await stored(links[row.robot - 1])
                    end = truth(row, now, held[row.robot - 1], plan)
                    ends[end] += 1
                    took_s.append(row.elapsed_s)
                    attempts += row.attempts
                    if not row.verified:
                        said[row.detail] += 1
                    if not same(now, held[row.robot - 1]):
                        held[row.robot - 1] = plan
                        if not same(now, plan):
                            await upload_fleet([plan], [links[row.robot - 1]])
            say(
                f"| {ENGINES[engine]} | {CLIENTS[client]} | {share} % "
                f"| {ends['verified']} of {tries} | {ends['old']} | {ends['empty']} "
                f"| {ends['unknown']} | {ends['WRONG']} "
                f"| {statistics.median(took_s):.1f} s | {max(took_s):.1f} s "
                f"| {attempts / tries:.2f} |"
            )
            for detail, often in said.most_common(4):
                say(f"<!-- {share} %: {often} x {detail} -->")


def say(line: str) -> None:
    """Write a line at once: a series takes minutes."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def badness(share: int, seed: int) -> Badness:
    """Return a link that loses `share` percent, and doubles and delays half as many."""
    loss = share / 100.0
    return Badness(loss=loss, duplicate=loss / 2.0, reorder=loss / 2.0, seed=seed)


async def speeds(engine: str, clients: list[str], counts: list[int]) -> None:
    """Print a row per client and number of items: median of three."""
    say("| vehicle | client | items | upload | read-back |")
    say("| --- " * 5 + "|")
    async with boats(engine, 1) as links:
        for client in clients:
            async with open_links(
                parse_connections(links), expected=1, timeouts=PATIENT, client=client
            ) as found:
                (vehicle,) = found.vehicles.values()
                for count in counts:
                    up_s, down_s = [], []
                    for number in range(3):
                        raw = to_raw(mission(1, number, count))[MissionType.MISSION]
                        await vehicle.clear(MissionType.MISSION)
                        began_s = time.perf_counter()
                        await vehicle.upload(MissionType.MISSION, raw)
                        sent_s = time.perf_counter()
                        read = await vehicle.download(MissionType.MISSION)
                        down_s.append(time.perf_counter() - sent_s)
                        up_s.append(sent_s - began_s)
                        assert not compare_items(raw, read, MissionType.MISSION)
                    say(
                        f"| {ENGINES[engine]} | {CLIENTS[client]} | {count} "
                        f"| {statistics.median(up_s):.2f} s | {statistics.median(down_s):.2f} s |"
                    )


def parsing(vehicles: int = 32, rate_hz: int = 50) -> None:
    """Print what a second of telemetry of a whole fleet costs, wanted or not."""
    codec = Codec(7, 1)
    count = vehicles * rate_hz
    stream = b"".join(
        codec.encode(mavlink.MAVLink_global_position_int_message(n, 1, 2, 3, 4, 5, 6, 7, 8))
        for n in range(count)
    )
    began_s = time.process_time()
    frames = FrameReader().feed(stream)
    cut_s = time.process_time() - began_s
    for frame in frames:
        codec.decode(frame)
    all_s = time.process_time() - began_s
    say(f"{count} messages: {cut_s * 1e3:.1f} ms cut into frames, {all_s * 1e3:.1f} ms decoded too")


def main() -> None:
    """Read the command line and measure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("loss", "speed", "parse"))
    parser.add_argument("--engine", choices=sorted(ENGINES), default="light")
    parser.add_argument("--client", choices=sorted(CLIENTS), nargs="+", default=sorted(CLIENTS))
    parser.add_argument("--losses", type=int, nargs="+", default=list(LOSSES))
    parser.add_argument("--counts", type=int, nargs="+", default=list(COUNTS))
    parser.add_argument("--tries", type=int, default=20)
    parser.add_argument("--boats", type=int, default=4, help="how many at once")
    given = parser.parse_args()
    if given.what == "parse":
        parsing()
        return
    if given.what == "speed":
        asyncio.run(speeds(given.engine, given.client, given.counts))
        return
    for client in given.client:
        asyncio.run(losses(given.engine, client, given.losses, given.tries, given.boats))


if __name__ == "__main__":
    main()
