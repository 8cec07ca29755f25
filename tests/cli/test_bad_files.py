"""81 bad files through the command line: the right exit code, one line, nothing written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from mrmission.cli.main import run


def test_every_bad_file_behaves(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    # planning itself is tried elsewhere: here a reader that gets through is enough
    monkeypatch.chdir(tmp_path)
    wrong = []
    entries = json.loads((shared_data / "bad" / "index.json").read_text())
    assert len(entries) == 81

    class Reached(Exception):  # noqa: N818
        pass

    def stop(*_: object, **__: object) -> None:
        raise Reached

    monkeypatch.setattr("mrmission.pipeline.plan", stop)
    for entry in entries:
        expected = {entry["expect"], entry.get("also_acceptable", entry["expect"])}
        file = shared_data / "bad" / entry["file"]
        code = run(["plan", str(file), "--out", "out"])
        out, err = capsys.readouterr()
        accepted = "Reached" in err
        json_like = file.suffix in (".geojson", ".json", ".geojsonl")
        may_refuse = "refuse" in expected or not json_like
        may_accept = expected & {"accept", "repair_with_warning"}
        if accepted and not may_accept:
            wrong.append((file.name, "was accepted", expected))
        if not accepted and (not may_refuse or code != 3 or err.count("\n") != 1):
            wrong.append((file.name, code, err))
        if "Traceback" in err or out or Path("out").exists():
            wrong.append((file.name, "traceback, output or files", err))
    assert not wrong


ACCEPTED = ["bom_utf8.geojson", "coords_3d.geojson", "islands_as_features.geojson"]


@pytest.mark.parametrize("name", ACCEPTED)
def test_accepted_ones_are_planned(
    name: str, shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
) -> None:
    monkeypatch.chdir(tmp_path)
    file = shared_data / "bad" / name
    flags = ["--out", "out", "--swath", "100", "--islands", "--no-fence"]
    code = run(["plan", str(file), *flags])
    err = capsys.readouterr().err
    assert code == 0, err
    assert "Traceback" not in err
    assert Path("out/robot-1.plan").is_file()
