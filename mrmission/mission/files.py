"""Files written whole or not at all."""

from __future__ import annotations

import contextlib
import os
import re
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from mrmission.errors import ConfigError
from mrmission.model import Mission

_PLAN_FILE = re.compile(r"robot-(\d+)(?:-sortie-(\d+))?\.plan")


def plan_files(folder: Path) -> list[tuple[int, int, Path]]:
    """Return robot, sortie and path of a folder's ``robot-*.plan`` files, by robot and sortie."""
    found = [(_PLAN_FILE.fullmatch(path.name), path) for path in folder.iterdir()]
    return sorted((int(m[1]), int(m[2] or 1), path) for m, path in found if m is not None)


def mission_names(missions: Sequence[Mission]) -> list[str]:
    """Return the file name of each mission, without suffix.

    ``robot-2`` where a robot goes out once, ``robot-2-sortie-1`` and so on where it goes out more
    often.

    Parameters
    ----------
    missions
        All of a plan, one for each robot and sortie.
    """
    trips = Counter(mission.robot for mission in missions)
    return [
        f"robot-{m.robot}" + (f"-sortie-{m.sortie}" if trips[m.robot] > 1 else "") for m in missions
    ]


def write_whole(path: str | os.PathLike[str], data: bytes | str, overwrite: bool = False) -> None:
    """Write a file whole or not at all, and never over another one unless asked to.

    The data goes to a temporary file in the same folder, which takes the name only when every byte
    is on the disk: whoever reads the name sees the old file or the new one, nothing in between.

    Parameters
    ----------
    path
        Where to write. Its folder is made when it is missing.
    data
        The content; text is written as UTF-8 without translating line ends.
    overwrite
        Whether a file that is already there may be replaced.

    Raises
    ------
    ConfigError
        When the file exists and `overwrite` is false, or when it cannot be written.
    """
    target = Path(path)
    content = data.encode("utf-8") if isinstance(data, str) else data
    temporary = ""
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        # mkstemp makes private files; give this one what open() would have given it
        umask = os.umask(0)
        os.umask(umask)
        Path(temporary).chmod(0o666 & ~umask)
        if overwrite:
            Path(temporary).replace(target)
        else:
            # a link fails when the name is taken, so that two writers cannot both win
            os.link(temporary, target)
    except FileExistsError:
        if not target.exists() or not target.parent.is_dir():
            raise ConfigError(
                f"{target}: a folder of this path is a file; choose another"
            ) from None
        raise ConfigError(f"{target}: exists already; use --overwrite to replace it") from None
    except OSError as error:
        raise ConfigError(f"{target}: cannot be written: {error.strerror or error}") from error
    finally:
        if temporary:
            with contextlib.suppress(FileNotFoundError):
                Path(temporary).unlink()
