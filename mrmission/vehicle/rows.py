"""What an upload says: a row per robot, steps on the way, and how long it waits."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field

from mrmission.vehicle.links import LinkTimeouts


class UploadStatus(enum.StrEnum):
    """How an upload to one vehicle ended."""

    VERIFIED = "verified"
    UNCHANGED = "already stored"
    ABSENT = "absent"
    REFUSED = "refused"
    FAILED = "failed"
    MISMATCH = "stored differently"


class Holds(enum.StrEnum):
    """What a vehicle holds when the upload to it has ended; never a mixture of old and new."""

    PLAN = "this plan"
    UNTOUCHED = "vehicle untouched"
    RESTORED = "old mission restored"
    EMPTY = "left empty"
    UNKNOWN = "unknown"
    NOBODY = "no vehicle"


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadRow:
    """What became of one robot's mission.

    ``attempts`` counts the tries that the whole upload took: 0 where nothing was sent, 1 where
    everything went through at once, one more for every operation that had to be repeated.
    """

    robot: int
    system_id: int | None
    link: str
    items: int
    fence_items: int
    rally_points: int
    length_m: float
    duration_s: float | None
    status: UploadStatus
    detail: str
    verified: bool
    holds: Holds
    attempts: int
    elapsed_s: float
    sortie: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadProgress:
    """A step of one vehicle; ``fraction`` runs from 0 to 1 over all that it gets."""

    robot: int
    system_id: int
    stage: str
    fraction: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UploadTimeouts:
    """Waiting and trying again, on top of a client's own repetitions of single packets.

    After an aborted transfer a vehicle holds it open for 8 s and denies everybody else, downloads
    too (`hold_s` spans it); straight after discovery it may refuse with TOO_MANY_MISSION_ITEMS
    what it accepts 4 s later. `pauses_s` are the pauses before each repetition: their number
    bounds the tries. A vehicle that fell silent, because it reboots or its link broke, is waited
    for `return_s`.
    """

    link: LinkTimeouts = field(default_factory=LinkTimeouts)
    pauses_s: tuple[float, ...] = (0.5, 4.0, 8.5, 12.0)
    hold_s: float = 8.5
    too_many_pause_s: float = 4.0
    return_s: float = 30.0
    restore_s: float = 90.0
    cleanup_s: float = 30.0


ProgressCallback = Callable[[UploadProgress], None]
