"""How much a vehicle holds, asked before anything is planned or sent, and whether a plan fits.

ArduPilot has no message for it, but an answer to a question: an upload announced with more items
than any store holds is refused with "Only N items are supported", and changes nothing. It works for
all three stores, and tells what the autopilot has at this moment, SD card or not. Where it is not
answered, parameters say whether there is a card (BRD_SD_MISSION, BRD_SD_FENCE); otherwise the
sizes of a common board are taken.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

from mrmission.errors import LinkTimeoutError, UploadError
from mrmission.model import Mission
from mrmission.options import VehicleLimits
from mrmission.vehicle.items import MissionType, to_raw
from mrmission.vehicle.links import (
    FENCE_OVERHEAD_BYTES,
    SD_FENCE_POLYGON_POINTS,
    StoreVehicle,
    sd_limits,
)

DEFAULT_SOURCE = "default"
FENCE_ITEM_BYTES = 8
"""ArduPilot tells the size of its fence store as so many points of 8 bytes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """One limit, and who says so."""

    value: int
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownLimits:
    """What a vehicle, or the smallest of several, holds, and where each number comes from."""

    mission_items: Limit
    fence_bytes: Limit
    rally_points: Limit

    @property
    def limits(self) -> VehicleLimits:
        """The numbers alone."""
        return VehicleLimits(
            mission_items=self.mission_items.value,
            fence_bytes=self.fence_bytes.value,
            fence_polygon_points=polygon_points(self.fence_bytes.value),
            rally_points=self.rally_points.value,
        )

    def __str__(self) -> str:
        units = ("mission items", "fence bytes", "rally points")
        named: dict[str, list[str]] = {}
        for item, unit in zip(fields(self), units, strict=True):
            limit: Limit = getattr(self, item.name)
            named.setdefault(limit.source, []).append(f"{limit.value} {unit}")
        return "; ".join(f"{', '.join(texts)} ({source})" for source, texts in named.items())


@dataclass(frozen=True, slots=True, kw_only=True)
class Caps:
    """Limits that the user gave; None where nothing was given."""

    mission_items: int | None = None
    fence_bytes: int | None = None


def polygon_points(fence_bytes: int) -> int:
    """Return how many points one polygon may have in a fence store of so many bytes."""
    return min(SD_FENCE_POLYGON_POINTS, (fence_bytes - 2) // 8)


def default_limits() -> KnownLimits:
    """Return what a common board holds, when nobody can be asked."""
    limits = VehicleLimits()
    return KnownLimits(
        mission_items=Limit(value=limits.mission_items, source=DEFAULT_SOURCE),
        fence_bytes=Limit(value=limits.fence_bytes, source=DEFAULT_SOURCE),
        rally_points=Limit(value=limits.rally_points, source=DEFAULT_SOURCE),
    )


async def ask_limits(vehicle: StoreVehicle) -> KnownLimits:
    """Return what a vehicle holds: as it says, else by its parameters, else by default.

    An armed vehicle is asked for parameters alone.
    """
    out = default_limits()
    with contextlib.suppress(LinkTimeoutError):
        await vehicle.wait_heartbeat()
    source = f"vehicle {vehicle.system_id}"
    rooms: dict[MissionType, int | None] = dict.fromkeys(MissionType)
    if not vehicle.armed:
        # One after the other: the vehicle's text does not say of which store it speaks.
        for kind in MissionType:
            rooms[kind] = await vehicle.room(kind)
    items, points, rally = (rooms[kind] for kind in MissionType)
    if items is None or points is None:
        mission_kib, fence_kib = await asyncio.gather(
            vehicle.parameter("BRD_SD_MISSION"), vehicle.parameter("BRD_SD_FENCE")
        )
        card = sd_limits(
            VehicleLimits(), mission_kib=mission_kib or 0.0, fence_kib=fence_kib or 0.0
        )
        if mission_kib is not None and mission_kib >= 1:
            out = replace(
                out,
                mission_items=Limit(value=card.mission_items, source=f"BRD_SD_MISSION of {source}"),
            )
        if fence_kib is not None and fence_kib >= 1:
            out = replace(
                out,
                fence_bytes=Limit(value=card.fence_bytes, source=f"BRD_SD_FENCE of {source}"),
            )
    if items is not None:
        out = replace(out, mission_items=Limit(value=items, source=source))
    if points is not None:
        # A store of no room at all would come out negative.
        size = max(0, FENCE_ITEM_BYTES * points - FENCE_OVERHEAD_BYTES)
        out = replace(out, fence_bytes=Limit(value=size, source=source))
    if rally is not None:
        out = replace(out, rally_points=Limit(value=rally, source=source))
    return out


async def ask_fleet(vehicles: Sequence[StoreVehicle]) -> dict[int, KnownLimits]:
    """Return what each vehicle holds, by system id; all are asked at the same time."""
    told = await asyncio.gather(*(ask_limits(vehicle) for vehicle in vehicles))
    return {v.system_id: limits for v, limits in zip(vehicles, told, strict=True)}


def smallest(known: Sequence[KnownLimits]) -> KnownLimits:
    """Return the smallest of each limit, with the word of whoever has it; defaults for nobody."""
    if not known:
        return default_limits()

    def least(limits: Sequence[Limit]) -> Limit:
        value = min(limit.value for limit in limits)
        sources = sorted({limit.source for limit in limits if limit.value == value}, key=_natural)
        more = f" and {len(sources) - 1} more" if len(sources) > 1 else ""
        return Limit(value=value, source=f"{sources[0]}{more}")

    return KnownLimits(
        mission_items=least([k.mission_items for k in known]),
        fence_bytes=least([k.fence_bytes for k in known]),
        rally_points=least([k.rally_points for k in known]),
    )


def _natural(text: str) -> tuple[int, str]:
    """Order vehicle 2 before vehicle 10."""
    return len(text), text


def capped(known: KnownLimits, caps: Caps) -> KnownLimits:
    """Return `known`, where what the user gave is smaller, as the user has it."""

    def cap(limit: Limit, value: int | None, flag: str) -> Limit:
        # What nobody was asked for is a guess, and the user may know better.
        guess = limit.source == DEFAULT_SOURCE
        if value is None or (value >= limit.value and not guess):
            return limit
        return Limit(value=value, source=flag)

    return replace(
        known,
        mission_items=cap(known.mission_items, caps.mission_items, "--max-items"),
        fence_bytes=cap(known.fence_bytes, caps.fence_bytes, "--fence-bytes"),
    )


def check_capacity(
    missions: Sequence[Mission],
    limits: KnownLimits | Mapping[int, KnownLimits],
    hint: Callable[[int], str] | str | None = None,
) -> None:
    """Refuse missions, fences and rally points that a vehicle cannot hold.

    Parameters
    ----------
    missions
        What is to be uploaded.
    limits
        The same for all, or by robot.
    hint
        What to do about it: text, or a function from the number of items that fit to text.

    Raises
    ------
    UploadError
        Naming the robot, the number, the limit, and whose word it is.
    """
    tightest: tuple[int, str, int] | None = None
    for mission in missions:
        known = limits if isinstance(limits, KnownLimits) else limits.get(mission.robot)
        if known is None:
            continue
        limit = known.limits
        raw = to_raw(mission)
        robot = f"robot {mission.robot}"
        over = len(raw[MissionType.MISSION]) - limit.mission_items
        if over > 0 and (tightest is None or over > tightest[0]):
            text = (
                f"{robot}: its mission has {len(raw[MissionType.MISSION])} items, and its vehicle "
                f"holds {limit.mission_items} ({known.mission_items.source})"
            )
            tightest = (over, text, limit.mission_items)
        fence_bytes = sum(limit.fence_bytes_of(len(p.points_e7)) for p in mission.fence)
        largest = max((len(p.points_e7) for p in mission.fence), default=0)
        if fence_bytes > limit.fence_bytes:
            raise UploadError(
                f"{robot}: its fence takes {fence_bytes} bytes, and its vehicle holds "
                f"{limit.fence_bytes} ({known.fence_bytes.source}); nothing was sent; plan with "
                f"--fence-bytes {limit.fence_bytes}, with --no-fence, or use a larger fence store"
            )
        if largest > limit.fence_polygon_points:
            raise UploadError(
                f"{robot}: a fence polygon has {largest} points, and its vehicle holds "
                f"{limit.fence_polygon_points} in one ({known.fence_bytes.source}); nothing was "
                "sent"
            )
        if len(mission.rally) > limit.rally_points:
            raise UploadError(
                f"{robot}: {len(mission.rally)} rally points, and its vehicle holds "
                f"{limit.rally_points} ({known.rally_points.source}); nothing was sent"
            )
    if tightest is not None:
        _, text, holds = tightest
        advice = hint(holds) if callable(hint) else hint
        raise UploadError(
            f"{text}; nothing was sent; {advice or 'take a wider --swath or a larger --k'}"
        )
