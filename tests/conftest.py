"""Shared fixtures: sample areas, the data beside the checkout, fleets of both engines."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from fleets import Engine, Pool, why_not
from hypothesis import settings

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"
NOT_TESTED = "ARDUPILOT NOT TESTED"

# `make test` tries the same examples everywhere; HYPOTHESIS_PROFILE=explore looks for new ones.
settings.register_profile("repeatable", derandomize=True)
settings.register_profile("explore", derandomize=False)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))


@pytest.fixture(scope="session")
def geofences() -> Path:
    return ROOT / "geofences"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    if not (SHARED / "data").is_dir():
        pytest.skip("the data folder ../shared/data is not beside this checkout")
    return SHARED / "data"


@pytest.fixture(scope="session")
def score_script() -> Path:
    path = SHARED / "score" / "score_missions.py"
    if not path.is_file():
        pytest.skip("../shared/score/score_missions.py is not beside this checkout")
    return path


@pytest.fixture(scope="session")
def ardupilot_pool() -> Iterator[Pool]:
    pool = Pool()
    yield pool
    pool.drop()


@pytest.fixture(params=["light", pytest.param("ardupilot", marks=pytest.mark.ardupilot)])
def engine(request: pytest.FixtureRequest, ardupilot_pool: Pool) -> Engine:
    """Light boats, then ArduPilot's: see tests/fleets.py."""
    return Engine(request.param, ardupilot_pool)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--engines",
        choices=("light", "both", "ardupilot"),
        default="both",
        help="light: skip the tests that need ArduPilot; ardupilot: run these alone, and fail "
        "when there is no ardurover; both (default): skip them where there is no program",
    )


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--engines") == "ardupilot" and (reason := why_not("ardurover")):
        raise pytest.UsageError(reason)


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    engines = config.getoption("--engines")
    if engines == "ardupilot":
        others = [item for item in items if item.get_closest_marker("ardupilot") is None]
        config.hook.pytest_deselected(items=others)
        items[:] = [item for item in items if item.get_closest_marker("ardupilot") is not None]
    for item in items:
        marker = item.get_closest_marker("ardupilot")
        if marker is None:
            continue
        reason = (
            f"{NOT_TESTED}: light boats only; make test-sitl runs these"
            if engines == "light"
            else why_not(marker.kwargs.get("program", "ardurover"))
        )
        if reason:
            item.add_marker(pytest.mark.skip(reason=reason))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Name every test that would have needed ArduPilot and did not run."""
    skipped: dict[str, list[str]] = {}
    for report in terminalreporter.stats.get("skipped", []):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else ""
        if NOT_TESTED in reason:
            skipped.setdefault(reason.removeprefix("Skipped: "), []).append(report.nodeid)
    for reason, names in skipped.items():
        terminalreporter.section(f"{reason} ({len(names)} tests)")
        for name in sorted(names):
            terminalreporter.line(name)


@pytest.fixture
def not_every_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bound few lines as many are: not by looking at every way to share them out."""
    from mrmission.minmax.bounds import lanes

    monkeypatch.setattr(lanes, "few_lines_makespan", lambda *_: 0.0)
