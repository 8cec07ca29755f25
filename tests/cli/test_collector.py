"""The collector is paused for a plan only, and comes back, whatever happens."""

from __future__ import annotations

import gc
from pathlib import Path

import pytest

from mrmission.cli.collector import paused_collector
from mrmission.cli.main import run


def test_it_is_off_inside_and_on_again_after_an_error() -> None:
    @paused_collector()
    def fail() -> None:
        assert not gc.isenabled()
        raise ValueError("boom")

    assert gc.isenabled()
    for _ in range(2):  # a decorated function may be called again
        with pytest.raises(ValueError, match="boom"):
            fail()
        assert gc.isenabled()


def test_it_stays_off_where_it_was_off() -> None:
    gc.disable()
    try:
        with paused_collector():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_commands_leave_it_on(tmp_path: Path) -> None:
    assert run(["plan", str(tmp_path / "no.geojson")]) == 3
    assert gc.isenabled()
