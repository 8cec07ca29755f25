"""One autopilot behind a link, over MAVSDK.

Why callbacks instead of ``mavsdk.asyncio``'s plugin classes: those block one thread of the event
loop's default executor per call. That executor has (cores + 4) threads, so that on two cores only
six vehicles are served at a time, and a blocked thread cannot be cancelled. Connections and
systems are ``mavsdk.asyncio``'s; transfers go through the callbacks underneath.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from mrmission.errors import LinkTimeoutError
from mrmission.vehicle.connection import Connection
from mrmission.vehicle.heard import Heard
from mrmission.vehicle.items import MissionType, RawItem
from mrmission.vehicle.links import (
    AUTOPILOT_COMPONENT_ID,
    GCS_COMPONENT_ID,
    GCS_SYSTEM_ID,
    MOST_ITEMS,
    NO_SPACE,
    ROOM_TEXT_S,
    ROOM_TRIES,
    LinkTimeouts,
    TransferError,
    items_supported,
)

MISSION_ACCEPTED = 0
ARDUPILOT = 3
REQUEST_MESSAGE = 512
GLOBAL_POSITION_INT = 33
_POLL_S = 0.05
_LISTENED = (
    "HEARTBEAT", "STATUSTEXT", "MISSION_COUNT", "MISSION_ACK", "PARAM_VALUE",
    "GLOBAL_POSITION_INT",
)  # fmt: skip


class Vehicle(Heard):
    """One autopilot behind a link: its state and its three stores (mission, fence, rally points).

    Nothing here arms, disarms, or changes a mode.
    """

    def __init__(self, system: Any, system_id: int, connection: Connection, t: LinkTimeouts):
        from mavsdk.plugins.mavlink_direct import MavlinkDirect
        from mavsdk.plugins.mission_raw import MissionRaw

        super().__init__(system_id, connection, t)
        self._queues: dict[str, set[asyncio.Queue[dict[str, Any]]]] = {}
        self._direct = MavlinkDirect(system._system)
        # A fence or rally transfer overwrites the mission total of its MissionRaw object, so the
        # mission has an object of its own.
        self._raw_mission = MissionRaw(system._system)
        self._raw_other = MissionRaw(system._system)
        for name in _LISTENED:
            self._direct.subscribe_message(name, self._receive)

    # --- messages --------------------------------------------------------------------------------

    def _receive(self, message: Any, _user_data: Any) -> None:
        """Take a message over from MAVSDK's thread into the event loop."""
        # The loop may be gone when a last message arrives during tear-down.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(
                self._dispatch,
                message.message_name,
                message.system_id,
                message.component_id,
                message.fields_json,
            )

    def _dispatch(self, name: str, system_id: int, component_id: int, fields_json: str) -> None:
        if system_id != self.system_id or component_id != AUTOPILOT_COMPONENT_ID:
            return
        fields = json.loads(fields_json)
        self._heard_s = self._loop.time()
        if name == "HEARTBEAT":
            self._take_heartbeat(
                *(int(fields[key]) for key in ("base_mode", "custom_mode", "type", "autopilot"))
            )
        elif name == "STATUSTEXT":
            self._texts.append(str(fields["text"]).rstrip("\0"))
        elif name.startswith("MISSION_") and not _meant_for_us(fields):
            return
        for queue in self._queues.get(name, ()):
            queue.put_nowait(fields)

    @contextlib.contextmanager
    def _listen(self, name: str) -> Iterator[asyncio.Queue[dict[str, Any]]]:
        queue: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self._queues.setdefault(name, set()).add(queue)
        try:
            yield queue
        finally:
            self._queues[name].discard(queue)

    def _send(self, name: str, **fields: Any) -> None:
        from mavsdk.exceptions import MavsdkError
        from mavsdk.plugins.mavlink_direct import MavlinkMessage

        fields = {
            "target_system": self.system_id,
            "target_component": AUTOPILOT_COMPONENT_ID,
            **fields,
        }
        message = MavlinkMessage(
            name, 0, 0, self.system_id, AUTOPILOT_COMPONENT_ID, json.dumps(fields)
        )
        try:
            self._direct.send_message(message)
        except MavsdkError as error:
            raise LinkTimeoutError(f"{self.where()}: {name} could not be sent: {error}") from error

    async def _reply(
        self,
        queue: asyncio.Queue[dict[str, Any]],
        accept: Callable[[dict[str, Any]], bool],
        timeout_s: float,
    ) -> dict[str, Any] | None:
        deadline = self._loop.time() + timeout_s
        while (left := deadline - self._loop.time()) > 0:
            try:
                fields = await asyncio.wait_for(queue.get(), left)
            except TimeoutError:
                break
            if accept(fields):
                return fields
        return None

    async def stored_count(self, mission_type: MissionType) -> int:
        """Return how many items a store holds, home included.

        Raises
        ------
        LinkTimeoutError
            When the vehicle does not answer.
        """
        with self._listen("MISSION_COUNT") as queue:
            for _ in range(4):
                self._send("MISSION_REQUEST_LIST", mission_type=int(mission_type))
                reply = await self._reply(
                    queue, lambda f: int(f["mission_type"]) == mission_type, self._timeouts.reply_s
                )
                if reply is not None:
                    return int(reply["count"])
        raise LinkTimeoutError(f"{self.where()}: does not say what its {mission_type.label} holds")

    async def twins(self) -> bool:
        """Return whether two vehicles answer to this system id on this one link.

        One request that is answered twice, and again twice when repeated, has two addressees; one
        double answer alone may be a duplicated packet or a late answer.
        """
        with self._listen("MISSION_COUNT") as queue:
            for _ in range(2):
                self._send("MISSION_REQUEST_LIST", mission_type=int(MissionType.MISSION))
                if await self._reply(queue, _any_message, self._timeouts.reply_s) is None:
                    return False
                if await self._reply(queue, _any_message, self._timeouts.twin_window_s) is None:
                    return False
        return True

    async def parameter(self, name: str) -> float | None:
        """Return a parameter's value, or None when the vehicle does not have or tell it."""
        with self._listen("PARAM_VALUE") as queue:
            for _ in range(2):
                self._send("PARAM_REQUEST_READ", param_id=name, param_index=-1)
                reply = await self._reply(
                    queue, lambda f: str(f["param_id"]).rstrip("\0") == name, 0.4
                )
                if reply is not None and reply["param_value"] is not None:
                    return float(reply["param_value"])
        return None

    async def room(self, mission_type: MissionType) -> int | None:
        """Return how many items a store takes at most, None where the vehicle does not tell.

        See the own client's.
        """
        if self.autopilot != ARDUPILOT:
            return None
        with self._listen("MISSION_ACK") as queue:
            for _ in range(ROOM_TRIES):
                self.forget_status_texts()
                self._send("MISSION_COUNT", count=MOST_ITEMS, mission_type=int(mission_type))
                reply = await self._reply(
                    queue, lambda f: int(f["mission_type"]) == mission_type, self._timeouts.reply_s
                )
                if reply is not None and int(reply["type"]) != NO_SPACE:
                    return None
                deadline_s = self._loop.time() + (ROOM_TEXT_S if reply is not None else 0.0)
                while (found := items_supported(self._texts)) is None:
                    if self._loop.time() >= deadline_s:
                        break
                    await asyncio.sleep(_POLL_S)
                if found is not None:
                    return found
        return None

    async def position(self) -> tuple[float, float] | None:
        """Return where the vehicle is, lon and lat in degrees; None without a position."""
        with self._listen("GLOBAL_POSITION_INT") as queue:
            for _ in range(3):
                self._send(
                    "COMMAND_LONG", command=REQUEST_MESSAGE, confirmation=0,
                    param1=GLOBAL_POSITION_INT, param2=0.0, param3=0.0, param4=0.0, param5=0.0,
                    param6=0.0, param7=0.0,
                )  # fmt: skip
                reply = await self._reply(queue, _any_message, self._timeouts.reply_s)
                if reply is not None:
                    lat, lon = int(reply["lat"]), int(reply["lon"])
                    return (lon * 1e-7, lat * 1e-7) if lat or lon else None
        return None

    # --- stores ----------------------------------------------------------------------------------

    async def upload(
        self,
        mission_type: MissionType,
        items: Sequence[RawItem],
        progress: Callable[[float], None] | None = None,
    ) -> None:
        """Write `items` into a store; one try of MAVSDK's, which repeats lost packets itself.

        Raises
        ------
        TransferError
            When the vehicle refuses or the transfer breaks off. The store then holds anything.
        """
        from mavsdk.plugins.mission_raw import MissionItem, MissionPlan

        wanted = [_to_mavsdk(MissionItem, item) for item in items]
        raw = self._raw_mission if mission_type is MissionType.MISSION else self._raw_other
        if mission_type is MissionType.MISSION:
            result, _ = await self._transfer(
                lambda done: raw.upload_mission_with_progress_async(
                    MissionPlan(wanted), lambda result, data, _user: done(result, data)
                ),
                raw.cancel_mission_upload,
                progress,
            )
        else:
            start = (
                raw.upload_geofence_async
                if mission_type is MissionType.FENCE
                else raw.upload_rally_points_async
            )
            result, _ = await self._transfer(
                lambda done: start(wanted, lambda result, _user: done(result, None)),
                raw.cancel_mission_upload,
            )
        self._check(result, f"upload of {mission_type.label}")

    async def download(self, mission_type: MissionType) -> tuple[RawItem, ...]:
        """Read a store back.

        Raises
        ------
        TransferError
            When the vehicle refuses or the transfer breaks off.
        """
        raw = self._raw_mission if mission_type is MissionType.MISSION else self._raw_other
        start = {
            MissionType.MISSION: raw.download_mission_async,
            MissionType.FENCE: raw.download_geofence_async,
            MissionType.RALLY: raw.download_rallypoints_async,
        }[mission_type]
        result, items = await self._transfer(
            lambda done: start(lambda result, data, _user: done(result, data)),
            raw.cancel_mission_download,
        )
        if result == "NO_MISSION_AVAILABLE":
            return ()
        self._check(result, f"read-back of {mission_type.label}")
        return tuple(_from_mavsdk(item) for item in items)

    async def clear(self, mission_type: MissionType) -> None:
        """Empty a store (a mission keeps its home) and wait for the vehicle's word on it.

        Raises
        ------
        TransferError
            When the vehicle refuses.
        LinkTimeoutError
            When it does not answer.
        """
        with self._listen("MISSION_ACK") as queue:
            for _ in range(4):
                self._send("MISSION_CLEAR_ALL", mission_type=int(mission_type))
                reply = await self._reply(
                    queue, lambda f: int(f["mission_type"]) == mission_type, self._timeouts.reply_s
                )
                if reply is None:
                    continue
                if int(reply["type"]) == MISSION_ACCEPTED:
                    return
                raise TransferError(
                    f"{self.where()}: refuses to clear its {mission_type.label} "
                    f"(MAV_MISSION_RESULT {reply['type']})",
                    result="DENIED",
                )
        raise LinkTimeoutError(f"{self.where()}: no answer to clearing its {mission_type.label}")

    async def _transfer(
        self,
        start: Callable[[Callable[[Any, Any], None]], None],
        cancel: Callable[[], Any],
        progress: Callable[[float], None] | None = None,
    ) -> tuple[str, Any]:
        """Run one MAVSDK transfer; MAVSDK's own time-outs bound it."""
        from mavsdk.exceptions import MavsdkError

        future: asyncio.Future[tuple[str, Any]] = self._loop.create_future()

        def finish(result: Any, data: Any) -> None:
            if result.name == "NEXT":
                if progress is not None:
                    progress(float(data.progress))
            elif not future.done():
                future.set_result((result.name, data))

        def done(result: Any, data: Any) -> None:
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(finish, result, data)

        start(done)
        try:
            return await future
        except asyncio.CancelledError:
            with contextlib.suppress(MavsdkError):
                cancel()
            raise

    def _check(self, result: str, what: str) -> None:
        if result == "SUCCESS":
            return
        raise TransferError(f"{self.where()}: {what} failed: {result}", result=result)


def _meant_for_us(fields: dict[str, Any]) -> bool:
    """Return whether a mission message is for this ground station, not for one beside it."""
    return int(fields.get("target_system", 0)) in (0, GCS_SYSTEM_ID) and int(
        fields.get("target_component", 0)
    ) in (0, GCS_COMPONENT_ID)


def _any_message(_fields: dict[str, Any]) -> bool:
    return True


def _to_mavsdk(kind: Any, item: RawItem) -> Any:
    return kind(
        item.seq, item.frame, item.command, item.current, item.autocontinue,
        item.param1, item.param2, item.param3, item.param4,
        item.x, item.y, item.z, int(item.mission_type),
    )  # fmt: skip


def _from_mavsdk(item: Any) -> RawItem:
    return RawItem(
        seq=item.seq,
        frame=item.frame,
        command=item.command,
        current=item.current,
        autocontinue=item.autocontinue,
        param1=item.param1,
        param2=item.param2,
        param3=item.param3,
        param4=item.param4,
        x=item.x,
        y=item.y,
        z=item.z,
        mission_type=item.mission_type,
    )
