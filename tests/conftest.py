"""Shared fixtures: paths to the sample areas, and to the data beside the checkout where it is."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"


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
