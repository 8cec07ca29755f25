"""Who sweeps what: the planners, one file each, one signature ``(problem, robots)``."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from mrmission.partition.cac import cac
from mrmission.partition.crc import crc
from mrmission.partition.fhk import fhk
from mrmission.partition.nrc import nrc
from mrmission.partition.problem import Assignment, CoverageProblem, Visit

Planner = Callable[[CoverageProblem, int], Assignment]

PLANNERS: Mapping[str, Planner] = {"crc": crc, "cac": cac, "fhk": fhk, "nrc": nrc}

__all__ = [
    "PLANNERS",
    "Assignment",
    "CoverageProblem",
    "Planner",
    "Visit",
    "cac",
    "crc",
    "fhk",
    "nrc",
]
