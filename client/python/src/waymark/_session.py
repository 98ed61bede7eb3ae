"""Opening a robot's zenoh session: its settings, encryption and queues."""

from __future__ import annotations

import json
import re
import socket
import ssl
import threading
from typing import Literal

import zenoh

from waymark.errors import NotAdmitted, TlsRefused, Unreachable
from waymark.robot_file import RobotFile

Delivery = Literal["latest", "every"]

# Largest message taken from the server, in bytes.
_MAX_MESSAGE_BYTES = 4 << 20
# What a droppable message waits for room on the link, in microseconds.
_DROP_US = 50_000
# A place in the source of zenoh, as its errors have it.
_SOURCE = re.compile(r"\s*\bat \S+\.rs:\d+\.?")
# Longest wait for a connection that only shows whether something listens, in seconds.
_PROBE_S = 0.5


def open_session(endpoint: str, delivery: Delivery, timeout_s: float, file: RobotFile | None) -> zenoh.Session:
    """Opens the session. A listener that is silent and not zenoh can hold a handshake longer than zenoh's own
    timeout, so it is opened on a thread of its own."""
    result: list[zenoh.Session | Exception] = []
    is_late = threading.Event()

    def run() -> None:
        try:
            session = zenoh.open(zenoh.Config.from_json5(_config(endpoint, delivery, timeout_s, file)))
            if is_late.is_set():
                session.close()
            result.append(session)
        except Exception as error:
            result.append(error)

    thread = threading.Thread(target=run, daemon=True, name="waymark-open")
    thread.start()
    thread.join(timeout_s + 1)
    opened = result[0] if result else None
    if isinstance(opened, zenoh.Session):
        return opened
    is_late.set()
    detail = f": {in_words(opened)}" if opened is not None else f" within {timeout_s} s"
    if file is not None and _is_turned_away(endpoint, file):
        raise NotAdmitted(f"the server at {endpoint} takes no messages of robot {file.robot} with this certificate")
    kind = TlsRefused if _listens(endpoint) else Unreachable
    raise kind(f"no session with a server at {endpoint}{detail}", field="endpoint") from opened


def in_words(error: Exception) -> str:
    """What zenoh says, without the places in its source: those are paths of the machine that built it."""
    return _SOURCE.sub("", str(error)).strip()


def _address(endpoint: str) -> tuple[str, int] | None:
    """Host and port of an encrypted endpoint."""
    protocol, _, address = endpoint.partition("/")
    host, _, port = address.rpartition(":")
    return (host.strip("[]"), int(port)) if protocol == "tls" and port.isdecimal() else None


def _listens(endpoint: str) -> bool:
    """Whether something takes connections at an encrypted endpoint."""
    address = _address(endpoint)
    if address is None:
        return False
    try:
        with socket.create_connection(address, timeout=_PROBE_S):
            return True
    except OSError:
        return False


def _is_turned_away(endpoint: str, file: RobotFile) -> bool:
    """Whether the server believes the certificate and closes in order: its holder is not admitted any more."""
    address = _address(endpoint)
    if address is None:
        return False
    try:
        context = ssl.create_default_context(cafile=None if file.authority is None else str(file.authority))
        context.load_cert_chain(file.certificate, file.key)
        with (
            socket.create_connection(address, timeout=_PROBE_S) as plain,
            context.wrap_socket(plain, server_hostname=address[0], suppress_ragged_eofs=False) as encrypted,
        ):
            return encrypted.recv(1) == b""
    except OSError:
        return False


def _config(endpoint: str, delivery: Delivery, timeout_s: float, file: RobotFile | None = None) -> str:
    # A session whose sender waits must not be closed.
    close_us = 60_000_000 if delivery == "every" else 5_000_000
    return json.dumps(
        {
            "mode": "client",
            "connect": {
                "endpoints": [endpoint],
                "timeout_ms": int(timeout_s * 1000),
                "retry": {"period_init_ms": 100, "period_max_ms": 2000},
            },
            "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
            "adminspace": {"enabled": False},
            "transport": {
                "link": {
                    "tx": {
                        "lease": 2000,
                        "queue": {
                            "congestion_control": {
                                "drop": {"wait_before_drop": _DROP_US, "max_wait_before_drop_fragments": _DROP_US},
                                "block": {"wait_before_close": close_us},
                            }
                        },
                    },
                    "rx": {"max_message_size": _MAX_MESSAGE_BYTES},
                    **({} if file is None else {"tls": file.settings()}),
                },
                "shared_memory": {"enabled": False},
            },
        }
    )
