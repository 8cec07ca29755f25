"""What one vehicle did: positions on its own clock, the item it steered for, and what it said."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mrmission.area.frame import LocalFrame
from mrmission.model import FloatArray, IntArray, read_only


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """A status text: when it came (the vehicle's clock, s), how severe it is, and the text."""

    time_s: float
    severity: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Breach:
    """A fence breach that a vehicle reported: when, and which fence (FENCE_BREACH number)."""

    time_s: float
    kind: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """The voyage of one vehicle.

    Every time is a second of the vehicle's own clock (``time_boot_ms``), which a simulator runs
    faster than the clock on the wall; no time-out and no speed-up changes what is measured.

    Attributes
    ----------
    robot, system_id
        Whose voyage it is.
    time_s
        (n,) strictly rising times of the positions.
    lonlat
        (n, 2) longitude, latitude, degrees.
    heading_deg
        (n,) where the bow points; NaN where the vehicle does not say.
    item
        (n,) sequence number of the mission item that the vehicle steered for; 0 before the start.
    started_s
        When the mission began to be executed.
    ended_s
        When the last waypoint was reached, NaN when it never was.
    reached
        (m, 2) time and sequence number of the navigation items reached, in order.
    truth
        (m, 3) time, longitude, latitude of where a simulator says the vehicle really was; empty
        where it does not say. The time is that of the last position before, so it may be early by
        one sample.
    texts, breaches
        What the vehicle said, and the fence breaches that it reported, in order.
    end_text
        Why the watch ended: ``home``, or what went wrong.
    sortie
        Which of the robot's trips it was.
    """

    robot: int
    system_id: int
    time_s: FloatArray
    lonlat: FloatArray
    heading_deg: FloatArray
    item: IntArray
    started_s: float
    ended_s: float
    reached: FloatArray
    truth: FloatArray
    texts: tuple[Said, ...]
    breaches: tuple[Breach, ...]
    end_text: str
    sortie: int = 1

    @property
    def home(self) -> bool:
        """Whether the mission was sailed to its end."""
        return math.isfinite(self.ended_s)

    @property
    def duration_s(self) -> float:
        """Seconds from the start of the mission to its last waypoint; NaN when that never came."""
        return self.ended_s - self.started_s

    def set_off(self) -> Track:
        """Return the same voyage begun when the vehicle left its first waypoint, at home.

        A mission may hold there: until then the vehicle lies at its berth.
        """
        left = np.flatnonzero((self.item > 1) & (self.time_s >= self.started_s))
        if not len(left):
            return self
        return replace(self, started_s=float(self.time_s[left[0]]))

    def points_m(self, frame: LocalFrame) -> FloatArray:
        """Return the (n, 2) positions in a local frame, m."""
        if not len(self.lonlat):
            return np.zeros((0, 2))
        lonlat = self.lonlat.copy()
        # a vehicle says -180..180; the frame is continuous about its centre
        lonlat[:, 0] = frame.lon_deg + (lonlat[:, 0] - frame.lon_deg + 180.0) % 360.0 - 180.0
        return frame.to_metric(lonlat)

    def under_way(self) -> np.ndarray:
        """Return (n,) which positions lie between the start and the last waypoint."""
        end = self.ended_s if self.home else math.inf
        return (self.time_s >= self.started_s) & (self.time_s <= end)

    def afterwards(self) -> np.ndarray:
        """Return (n,) which positions come after the last waypoint was reached."""
        return self.time_s > (self.ended_s if self.home else math.inf)


class Recorder:
    """Collects a :class:`Track` while it is sailed."""

    def __init__(self, robot: int, system_id: int) -> None:
        self.robot = robot
        self.system_id = system_id
        self.now_s = 0.0
        self.item = 0
        self.started_s = math.nan
        self.ended_s = math.nan
        self.end_text = ""
        self._rows: list[tuple[float, float, float, float, int]] = []
        self._reached: list[tuple[float, float]] = []
        self._truth: list[tuple[float, float, float]] = []
        self._texts: list[Said] = []
        self._breaches: list[Breach] = []

    @property
    def position_lonlat(self) -> tuple[float, float] | None:
        """The last position."""
        return (self._rows[-1][1], self._rows[-1][2]) if self._rows else None

    def position(self, time_s: float, lon_deg: float, lat_deg: float, heading_deg: float) -> None:
        """Take a position; one that is not later than the last is a repetition and left out."""
        if self._rows and time_s <= self._rows[-1][0]:
            return
        self.now_s = time_s
        self._rows.append((time_s, lon_deg, lat_deg, heading_deg, self.item))

    def truth(self, lon_deg: float, lat_deg: float) -> None:
        """Take a true position, as a simulator knows it."""
        self._truth.append((self.now_s, lon_deg, lat_deg))

    def reach(self, seq: int) -> None:
        """Take the sequence number of an item reached."""
        if all(int(old) != seq for _, old in self._reached):
            self._reached.append((self.now_s, float(seq)))

    def say(self, severity: int, text: str) -> None:
        """Take a status text."""
        self._texts.append(Said(time_s=self.now_s, severity=severity, text=text))

    def breach(self, kind: int) -> None:
        """Take a fence breach."""
        self._breaches.append(Breach(time_s=self.now_s, kind=kind))

    def track(self) -> Track:
        """Return what was collected."""
        rows = np.array(self._rows, dtype=np.float64).reshape(-1, 5)
        return Track(
            robot=self.robot,
            system_id=self.system_id,
            time_s=read_only(rows[:, 0].copy()),
            lonlat=read_only(rows[:, 1:3].copy()),
            heading_deg=read_only(rows[:, 3].copy()),
            item=read_only(rows[:, 4].astype(np.int64)),
            started_s=self.started_s,
            ended_s=self.ended_s,
            reached=read_only(np.array(self._reached, dtype=np.float64).reshape(-1, 2)),
            truth=read_only(np.array(self._truth, dtype=np.float64).reshape(-1, 3)),
            texts=tuple(self._texts),
            breaches=tuple(self._breaches),
            end_text=self.end_text,
        )
