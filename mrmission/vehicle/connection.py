"""What a user writes after ``--connect``, checked and turned into one form."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from mrmission.errors import ConfigError

SITL_HOST = "127.0.0.1"
SITL_FIRST_PORT = 5760
SITL_PORT_STEP = 10

_SCHEMES = {
    "tcp": "tcpout",
    "tcpout": "tcpout",
    "tcpin": "tcpin",
    "udp": "udpin",
    "udpin": "udpin",
    "udpout": "udpout",
    "serial": "serial",
}
_HELP = (
    "use tcpout://HOST:PORT, udpin://HOST:PORT, udpout://HOST:PORT, serial://DEVICE:BAUD, "
    "tcp:HOST:PORT or udp:HOST:PORT"
)
_NETWORK = re.compile(r"(?P<scheme>[a-z]+):(?://)?(?P<host>[^:/\[\]]*|\[[^\]]+\]):(?P<port>\d+)")
_SERIAL = re.compile(r"serial:(?://)?(?P<device>/?[^:]+)(?::(?P<baud>\d+))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Connection:
    """One link to one or several vehicles.

    ``url`` is the form that messages show and MAVSDK opens; ``scheme`` one of tcpout, tcpin, udpin,
    udpout, serial; ``host`` and ``port`` belong to a network link, ``device`` and ``baud`` to a
    serial one.
    """

    url: str
    scheme: str
    host: str = ""
    port: int = 0
    device: str = ""
    baud: int = 0

    @property
    def answers_probe(self) -> bool:
        """Whether a plain TCP connect tells if anything listens there."""
        return self.scheme == "tcpout"


def parse_connection(text: str) -> Connection:
    """Return the connection that `text` names.

    Parameters
    ----------
    text
        ``tcpout://HOST:PORT``, ``udpin://HOST:PORT``, ``udpout://HOST:PORT``,
        ``serial://DEVICE[:BAUD]``, or short ``tcp:HOST:PORT`` (a vehicle or router that listens)
        and ``udp:HOST:PORT`` (listen for vehicles there).

    Raises
    ------
    ConfigError
        When it has none of these forms.

    Examples
    --------
    >>> parse_connection("tcp:127.0.0.1:5760").url
    'tcpout://127.0.0.1:5760'
    >>> parse_connection("udp::14550").url
    'udpin://0.0.0.0:14550'
    """
    cleaned = text.strip()
    serial = _SERIAL.fullmatch(cleaned)
    if serial is not None:
        device, baud = serial["device"], serial["baud"] or "57600"
        return Connection(
            url=f"serial://{device}:{baud}", scheme="serial", device=device, baud=int(baud)
        )
    network = _NETWORK.fullmatch(cleaned)
    if network is None or network["scheme"] not in _SCHEMES:
        raise ConfigError(f"--connect {text}: not a connection; {_HELP}")
    scheme = _SCHEMES[network["scheme"]]
    port = int(network["port"])
    if not 1 <= port <= 65535:
        raise ConfigError(f"--connect {text}: port {port} must lie between 1 and 65535")
    host = network["host"]
    if not host:
        if scheme in ("tcpout", "udpout"):
            raise ConfigError(f"--connect {text}: no host; {_HELP}")
        host = "0.0.0.0"
    return Connection(url=f"{scheme}://{host}:{port}", scheme=scheme, host=host, port=port)


def parse_connections(texts: Sequence[str]) -> tuple[Connection, ...]:
    """Return the connections that `texts` name, in order.

    Raises
    ------
    ConfigError
        When one cannot be read, or is given twice.
    """
    out = tuple(parse_connection(text) for text in texts)
    seen: set[str] = set()
    for text, connection in zip(texts, out, strict=True):
        if connection.url in seen:
            raise ConfigError(f"--connect {text}: given twice; each link once is enough")
        seen.add(connection.url)
    return out


def default_connections(count: int) -> tuple[Connection, ...]:
    """Return the `count` loopback ports that as many ArduPilot SITL instances open."""
    ports = (SITL_FIRST_PORT + SITL_PORT_STEP * i for i in range(count))
    return tuple(parse_connection(f"tcpout://{SITL_HOST}:{port}") for port in ports)
