"""The lines that a mission's vehicle follows, for files that show them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mrmission.mission import mavlink
from mrmission.model import LegKind, Mission


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """Consecutive legs of one kind and lane. ``points_e7`` are (lat, lon) in 1e-7 degrees."""

    kind: LegKind
    lane: int
    from_item: int
    to_item: int
    points_e7: tuple[tuple[int, int], ...]


def tracks(mission: Mission) -> Iterator[Track]:
    """Yield the lanes and transits of a mission in order, from home to home.

    Parameters
    ----------
    mission
        Its ``kind`` and ``lane`` say what each leg is for; where they are missing (a plan read
        from a file) every leg counts as transit.
    """
    points: list[tuple[int, int]] = []
    here: tuple[int, int, int] | None = None  # item, latitude, longitude
    what: tuple[int, int] = (LegKind.TRANSIT, 0)
    first = last = 0
    for index, item in enumerate(mission.items):
        if item.command not in mavlink.NAVIGATION or (item.x == 0 and item.y == 0):
            continue
        if here is not None and here[1:] != (item.x, item.y):
            kind = mission.kind[index] if mission.kind else LegKind.TRANSIT
            lane = mission.lane[index] if mission.lane else 0
            if points and what != (kind, lane):
                yield _track(what, first, last, points)
                points = []
            if not points:
                what, first, points = (kind, lane), here[0], [here[1:]]
            points.append((item.x, item.y))
            last = item.seq
        here = (item.seq, item.x, item.y)
    if points:
        yield _track(what, first, last, points)


_WORDS = {"lane": "lane", "shore": "lap", "tie": "tie line", "extra": "extra"}


def line_label(mission: Mission, lane: int) -> str:
    """Return what people call lane `lane` of a mission: ``lane 17b``, ``tie line T3``."""
    if 0 < lane <= len(mission.lines):
        line = mission.lines[lane - 1]
        return f"{_WORDS.get(line.kind, line.kind)} {line.name}"
    return f"lane {lane}"


def _track(what: tuple[int, int], first: int, last: int, points: list[tuple[int, int]]) -> Track:
    return Track(
        kind=LegKind(what[0]),
        lane=what[1],
        from_item=first,
        to_item=last,
        points_e7=tuple(points),
    )
