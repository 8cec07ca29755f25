"""What may stand after --connect."""

from __future__ import annotations

import pytest

from mrmission.errors import ConfigError
from mrmission.vehicle.connection import default_connections, parse_connection, parse_connections


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("tcpout://127.0.0.1:5760", "tcpout://127.0.0.1:5760"),
        ("tcp:boat-3.local:5760", "tcpout://boat-3.local:5760"),
        ("tcp://10.0.0.7:5760", "tcpout://10.0.0.7:5760"),
        ("tcpout://[::1]:5760", "tcpout://[::1]:5760"),
        ("udpin://0.0.0.0:14550", "udpin://0.0.0.0:14550"),
        ("udp::14550", "udpin://0.0.0.0:14550"),
        ("udp:127.0.0.1:14550", "udpin://127.0.0.1:14550"),
        ("udpout://192.168.1.9:14550", "udpout://192.168.1.9:14550"),
        ("serial:///dev/ttyUSB0:115200", "serial:///dev/ttyUSB0:115200"),
        ("serial:///dev/ttyUSB0", "serial:///dev/ttyUSB0:57600"),
        ("serial:COM7:57600", "serial://COM7:57600"),
    ],
)
def test_accepted_forms(text: str, url: str) -> None:
    assert parse_connection(text).url == url


@pytest.mark.parametrize(
    "text",
    ["", "5760", "127.0.0.1:5760", "tcp:127.0.0.1", "tcp:127.0.0.1:0", "tcp:127.0.0.1:65536",
     "tcpout://:5760", "http://127.0.0.1:80", "udpin://0.0.0.0:x", "serial:", "tcp:a:b:1"],
)  # fmt: skip
def test_refused_forms_name_themselves(text: str) -> None:
    with pytest.raises(ConfigError, match="--connect"):
        parse_connection(text)


def test_the_same_link_twice_is_refused() -> None:
    with pytest.raises(ConfigError, match="twice"):
        parse_connections(["tcp:127.0.0.1:5760", "tcpout://127.0.0.1:5760"])


def test_default_ports_are_those_of_sitl() -> None:
    urls = [c.url for c in default_connections(3)]
    assert urls == [f"tcpout://127.0.0.1:{port}" for port in (5760, 5770, 5780)]
