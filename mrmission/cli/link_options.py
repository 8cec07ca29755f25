"""Flags of commands that talk to vehicles: which links, which client, which key."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from mrmission.errors import ConfigError, InputError

if TYPE_CHECKING:
    from mrmission.vehicle.framing import Signing

F = TypeVar("F", bound=Callable[..., Any])

CLIENTS = ("pymavlink", "mavsdk")


def link_options(default: str) -> Callable[[F], F]:
    """Add ``--connect``, ``--client`` and ``--sign-key-file`` to a command.

    Parameters
    ----------
    default
        Which links are taken when none is given.
    """

    def add(command: F) -> F:
        for option in reversed(
            (
                click.option(
                    "--connect",
                    multiple=True,
                    metavar="LINK",
                    help="tcpout://HOST:PORT, udpin://HOST:PORT, udpout://HOST:PORT, "
                    "serial://DEVICE:BAUD; once per robot, or one link that carries all.  "
                    f"[default: {default}]",
                ),
                click.option(
                    "--client",
                    type=click.Choice(CLIENTS),
                    default=CLIENTS[0],
                    show_default=True,
                    help="What speaks MAVLink: the program's own client, or MAVSDK.",
                ),
                click.option(
                    "--sign-key-file",
                    type=click.Path(path_type=Path, dir_okay=False),
                    help="File with the passphrase of signed links, as given to Mission Planner.",
                ),
            )
        ):
            command = option(command)
        return command

    return add


def read_signing(path: Path | None, client: str) -> Signing | None:
    """Return the key of a passphrase file, None where no file is named.

    Raises
    ------
    ConfigError
        When the client cannot sign.
    InputError
        When the file cannot be read, or is empty.
    """
    if path is None:
        return None
    if client != "pymavlink":
        raise ConfigError("--sign-key-file: MAVSDK cannot sign; use --client pymavlink")
    try:
        text = path.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"--sign-key-file {path}: cannot be read: {error}") from error
    if not text:
        raise InputError(f"--sign-key-file {path}: is empty; write the passphrase into it")
    from mrmission.vehicle.framing import Signing

    return Signing.from_passphrase(text)
