"""The picture for a paper."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest
from factories import make_plan
from PIL import Image

from mrmission.errors import ConfigError
from mrmission.report import figure as module
from mrmission.report.colours import robot_colour
from mrmission.report.figure import save_figure

pytest.importorskip("matplotlib", reason="the extra mrmission[figure] is not installed")


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_same_plan_same_bytes(tmp_path, suffix):
    first = save_figure(make_plan(), tmp_path / f"a.{suffix}", dpi=60)
    second = save_figure(make_plan(), tmp_path / f"b.{suffix}", dpi=60)
    content = first.read_bytes()
    assert content == second.read_bytes()
    assert not re.search(rb"CreationDate|<dc:date|tIME", content)


def test_every_robot_is_in_the_picture(tmp_path):
    path = save_figure(make_plan(robots=6), tmp_path / "a.png", dpi=150)
    with Image.open(path) as image:
        pixels = np.asarray(image.convert("RGB")).reshape(-1, 3).astype(int)
    for robot in range(1, 7):
        colour = np.array([int(robot_colour(robot)[i : i + 2], 16) for i in (1, 3, 5)])
        assert (np.abs(pixels - colour).max(axis=1) < 10).sum() > 100


def test_words_and_names_are_text(tmp_path):
    path = save_figure(make_plan(name="Lake $x^ & <b>"), tmp_path / "a.svg")
    text = path.read_text(encoding="utf-8")
    assert "Lake $x^ &amp; &lt;b&gt;" in text
    for word in ("200 m", ">transit<", ">unreached<", "area bound"):
        assert word in text


def test_picture_is_as_wide_as_asked(tmp_path):
    path = save_figure(make_plan(), tmp_path / "a.png", width_mm=90, dpi=254)
    with Image.open(path) as image:
        assert image.width == 900


def test_an_existing_file_is_kept(tmp_path):
    path = tmp_path / "a.png"
    path.write_text("mine")
    with pytest.raises(ConfigError, match="--overwrite"):
        save_figure(make_plan(), path)
    assert path.read_text() == "mine"
    save_figure(make_plan(), path, dpi=40, overwrite=True)
    assert path.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("a.jpg", r"\.jpg.*\.png, \.svg or \.pdf"),
        ("a", r"no suffix"),
        ("missing/a.png", r"there is no folder"),
    ],
)
def test_paths_that_cannot_be_written(tmp_path, name, words):
    with pytest.raises(ConfigError, match=words):
        save_figure(make_plan(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


def test_without_matplotlib_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "find_spec", lambda name: None)
    with pytest.raises(ConfigError, match=r"mrmission\[figure\]"):
        save_figure(make_plan(), tmp_path / "a.png")


def test_report_needs_no_matplotlib_to_import():
    import subprocess

    code = "import sys, mrmission.report.figure, mrmission.report.map_page, mrmission.report.table;"
    code += "sys.exit(any(name in sys.modules for name in ('matplotlib', 'rich', 'scipy')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
