"""What both MAVLink clients share: time-outs, limits, errors, and the choice between them.

`client` is the project's own, on pymavlink; `mavsdk_link` is over MAVSDK.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from mrmission.errors import ConfigError, UploadError, VehicleError
from mrmission.options import VehicleLimits
from mrmission.vehicle.connection import Connection
from mrmission.vehicle.items import MissionType, RawItem

if TYPE_CHECKING:
    from mrmission.vehicle.framing import Signing

GCS_SYSTEM_ID = 245
GCS_COMPONENT_ID = 190
AUTOPILOT_COMPONENT_ID = 1
ARMED_FLAG = 128
CLIENTS = ("pymavlink", "mavsdk")

MOST_ITEMS = 65535
"""A list of so many items is announced to be refused: see `StoreVehicle.room`."""
ROOM_TRIES = 3
ROOM_TEXT_S = 0.5
"""The text with the number comes with the refusal, or right after it."""
NO_SPACE = 4
"""MAV_MISSION_RESULT of a store that is too small."""

MISSION_ITEM_BYTES = 15
MISSION_HEADER_BYTES = 4
SD_FENCE_POLYGON_POINTS = 255
FENCE_OVERHEAD_BYTES = 5

_ROVER_MODES = {
    0: "MANUAL", 1: "ACRO", 3: "STEERING", 4: "HOLD", 5: "LOITER", 6: "FOLLOW", 7: "SIMPLE",
    8: "DOCK", 9: "CIRCLE", 10: "AUTO", 11: "RTL", 12: "SMART_RTL", 15: "GUIDED",
}  # fmt: skip
_COPTER_MODES = {
    0: "STABILIZE", 2: "ALT_HOLD", 3: "AUTO", 4: "GUIDED", 5: "LOITER", 6: "RTL", 9: "LAND",
    16: "POSHOLD", 17: "BRAKE", 21: "SMART_RTL",
}  # fmt: skip
_MODES = {10: _ROVER_MODES, 11: _ROVER_MODES, 2: _COPTER_MODES, 13: _COPTER_MODES}
"""Mode names by MAV_TYPE."""

V_co = TypeVar("V_co", covariant=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkTimeouts:
    """How long to wait for what.

    A heartbeat comes once a second, so `settle_s` is what it takes to hear every vehicle of a link
    that carries several, and `discovery_s` leaves room for lost ones.
    """

    probe_s: float = 1.0
    retry_probe_s: float = 3.0
    discovery_s: float = 6.0
    settle_s: float = 1.3
    reply_s: float = 1.0
    twin_window_s: float = 0.3
    silence_s: float = 10.0


class TransferError(UploadError):
    """A mission transfer that failed; ``result`` is the reason, by MAVSDK's name for it."""

    def __init__(self, message: str, *, result: str) -> None:
        super().__init__(message)
        self.result = result


class StoreVehicle(Protocol):
    """What an upload needs of a vehicle, whichever client talks to it."""

    @property
    def system_id(self) -> int:
        """MAVLink system id."""

    @property
    def connection(self) -> Connection:
        """Link on which the vehicle is heard."""

    @property
    def armed(self) -> bool:
        """Whether the last heartbeat said armed; a vehicle not heard yet counts as armed."""

    @property
    def mode(self) -> str:
        """Name of the mode in the last heartbeat."""

    @property
    def silent(self) -> bool:
        """Whether nothing was heard for longer than a link may drop heartbeats."""

    def status_texts(self) -> tuple[str, ...]:
        """Return the last status texts, oldest first."""

    def forget_status_texts(self) -> None:
        """Drop the status texts seen so far."""

    async def wait_heartbeat(self) -> None:
        """Wait until the vehicle has said whether it is armed."""

    async def stored_count(self, mission_type: MissionType) -> int:
        """Return how many items a store holds, home included."""

    async def twins(self) -> bool:
        """Return whether two vehicles answer to this system id on this one link."""

    async def parameter(self, name: str) -> float | None:
        """Return a parameter's value, None where the vehicle does not have or tell it."""

    async def room(self, mission_type: MissionType) -> int | None:
        """Return how many items a store takes at most, None where the vehicle does not tell."""

    async def position(self) -> tuple[float, float] | None:
        """Return where the vehicle is, lon and lat in degrees; None without a position."""

    async def upload(
        self,
        mission_type: MissionType,
        items: Sequence[RawItem],
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Write `items` into a store."""

    async def download(self, mission_type: MissionType) -> tuple[RawItem, ...]:
        """Read a store back."""

    async def clear(self, mission_type: MissionType) -> None:
        """Empty a store."""


V = TypeVar("V", bound=StoreVehicle)


@dataclass(slots=True)
class FleetLinks(Generic[V_co]):
    """Open links and the vehicles found on them, by system id."""

    vehicles: dict[int, V_co]
    silent: dict[str, str]
    """Links without any vehicle: url to reason."""


@contextlib.asynccontextmanager
async def open_links(
    connections: Sequence[Connection],
    *,
    expected: int,
    timeouts: LinkTimeouts,
    patient: bool = True,
    client: str = "pymavlink",
    signing: Signing | None = None,
) -> AsyncIterator[FleetLinks[StoreVehicle]]:
    """Open links with the client of that name; see `mrmission.vehicle.client.open_links`.

    Parameters
    ----------
    connections, expected, timeouts, patient
        As there.
    client
        One of `CLIENTS`.
    signing
        Key of signed links; MAVSDK has none for its transfers.

    Raises
    ------
    ConfigError
        When there is no such client, or it cannot sign.
    VehicleError
        When two vehicles have one system id. Nothing has been sent then.
    """
    if client == "mavsdk":
        if signing is not None:
            raise ConfigError("--sign-key-file: MAVSDK cannot sign; use --client pymavlink")
        from mrmission.vehicle.mavsdk_link import open_links as open_over_mavsdk

        async with open_over_mavsdk(
            connections, expected=expected, timeouts=timeouts, patient=patient
        ) as over_mavsdk:
            yield FleetLinks(vehicles=dict(over_mavsdk.vehicles), silent=over_mavsdk.silent)
    elif client == "pymavlink":
        from mrmission.vehicle.client import open_links as open_own

        async with open_own(
            connections, expected=expected, timeouts=timeouts, patient=patient, signing=signing
        ) as over_own:
            yield FleetLinks(vehicles=dict(over_own.vehicles), silent=over_own.silent)
    else:
        raise ConfigError(f"--client {client}: no such client; use {' or '.join(CLIENTS)}")


def mode_name(vehicle_type: int, custom_mode: int) -> str:
    """Return the name of an ArduPilot mode.

    Examples
    --------
    >>> mode_name(11, 10), mode_name(2, 99)
    ('AUTO', 'mode 99')
    """
    return _MODES.get(vehicle_type, {}).get(custom_mode, f"mode {custom_mode}")


def sd_limits(default: VehicleLimits, *, mission_kib: float, fence_kib: float) -> VehicleLimits:
    """Return `default`, widened by what an SD card of the given storage sizes holds.

    Parameters
    ----------
    default
        Limits without a card.
    mission_kib, fence_kib
        BRD_SD_MISSION and BRD_SD_FENCE; 0 where there is no card.
    """
    out = default
    if mission_kib >= 1:
        items = (int(mission_kib) * 1024 - MISSION_HEADER_BYTES) // MISSION_ITEM_BYTES
        out = replace(out, mission_items=max(out.mission_items, items))
    if fence_kib >= 1:
        out = replace(
            out,
            fence_bytes=max(out.fence_bytes, int(fence_kib) * 1024 - FENCE_OVERHEAD_BYTES),
            fence_polygon_points=max(out.fence_polygon_points, SD_FENCE_POLYGON_POINTS),
        )
    return out


def items_supported(texts: Iterable[str]) -> int | None:
    """Return N of an autopilot's status text "Only N items are supported", if it said that.

    Examples
    --------
    >>> items_supported(["EKF3 active", "Only 655 items are supported"])
    655
    """
    for text in reversed(list(texts)):
        words = text.split()
        if words[:1] == ["Only"] and words[2:4] == ["items", "are"] and words[1].isdigit():
            return int(words[1])
    return None


async def distinct(found: Iterable[tuple[Connection, Mapping[int, V]]]) -> dict[int, V]:
    """Return the vehicles of all links by system id.

    Raises
    ------
    VehicleError
        When two have the same, on two links or on one.
    """
    vehicles: dict[int, V] = {}
    for connection, here in found:
        for system_id, vehicle in here.items():
            if system_id in vehicles:
                raise same_id_error(system_id, vehicles[system_id].connection, connection)
            vehicles[system_id] = vehicle
    ordered = dict(sorted(vehicles.items()))
    for vehicle, twins in zip(
        ordered.values(), await asyncio.gather(*(v.twins() for v in ordered.values())), strict=True
    ):
        if twins:
            raise same_id_error(vehicle.system_id, vehicle.connection, vehicle.connection)
    return ordered


def same_id_error(system_id: int, first: Connection, second: Connection) -> VehicleError:
    """Return the error for two vehicles with one system id, on one link or two."""
    where = (
        f"both on {first.url}" if first.url == second.url else f"on {first.url} and {second.url}"
    )
    return VehicleError(
        f"two vehicles have system id {system_id}, {where}: nothing was sent; give each vehicle "
        "its own (MAV_SYSID, formerly SYSID_THISMAV; --sysid in SITL) and run the command again"
    )


def os_reason(error: OSError) -> str:
    """Return an operating system's reason in a few words."""
    if isinstance(error, ConnectionRefusedError):
        return "connection refused"
    return error.strerror or str(error)
