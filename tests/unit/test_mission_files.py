from __future__ import annotations

from pathlib import Path

import pytest

from mrmission.errors import ConfigError
from mrmission.mission.files import write_whole


def test_writes_and_makes_the_folder(tmp_path: Path) -> None:
    write_whole(tmp_path / "a" / "b.txt", "grüße\n")
    assert (tmp_path / "a" / "b.txt").read_bytes() == "grüße\n".encode()
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["b.txt"]
    assert (tmp_path / "a" / "b.txt").stat().st_mode & 0o400


def test_never_clobbers_unless_asked(tmp_path: Path) -> None:
    path = tmp_path / "a.txt"
    write_whole(path, b"one")
    with pytest.raises(ConfigError, match="--overwrite"):
        write_whole(path, b"two")
    assert path.read_bytes() == b"one"
    write_whole(path, b"two", overwrite=True)
    assert path.read_bytes() == b"two"
    assert len(list(tmp_path.iterdir())) == 1


def test_a_failed_write_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="file"):
        write_whole(tmp_path / "file" / "b.txt", "x")
    with pytest.raises(ConfigError, match="cannot be written"):
        write_whole(tmp_path, "x", overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == ["file"]
