"""How many tie lines are asked for: a share of the lanes' length, or a spacing."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mrmission.errors import ConfigError

MAX_SHARE = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TieSpec:
    """How many tie lines: a share of the lanes' length, or a spacing; one of the two.

    Raises
    ------
    ConfigError
        When a value is out of range.
    """

    share: float | None = None
    spacing_m: float | None = None

    def __post_init__(self) -> None:
        if (self.share is None) == (self.spacing_m is None):
            raise ConfigError("--tie-lines: give a share like 5% or a spacing like 200m")
        if self.share is not None and not 0 < self.share <= MAX_SHARE:
            raise ConfigError(
                f"--tie-lines {self.share * 100:g}%: must be above 0 % and at most 100 %"
            )
        if self.spacing_m is not None and not 1 <= self.spacing_m < math.inf:
            raise ConfigError(f"--tie-lines {self.spacing_m:g}m: must be at least 1 m")

    def __str__(self) -> str:
        if self.share is not None:
            return f"{self.share * 100:.6g}%"
        return f"{self.spacing_m:.6g}m"


def parse_ties(text: str) -> TieSpec:
    """Return what ``5%`` or ``200m`` asks for.

    Raises
    ------
    ConfigError
        When it is neither, or out of range.

    Examples
    --------
    >>> parse_ties("5%").share, parse_ties("200 m").spacing_m
    (0.05, 200.0)
    """
    word = text.strip().lower()
    try:
        if word.endswith("%"):
            return TieSpec(share=float(word[:-1]) / 100)
        if word.endswith("m"):
            return TieSpec(spacing_m=float(word[:-1]))
    except ConfigError:
        raise
    except ValueError:
        pass
    raise ConfigError(
        f"--tie-lines {text}: must be a share of the lanes' length like 5%, or a spacing like 200m"
    )
