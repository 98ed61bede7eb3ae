"""The token of a server on this machine.

A server on loopback says with 401 in which file its local token is. That file is read only if it is a local token, of
this user, for the very port that was asked. In: the header. Out: the token.
"""

from __future__ import annotations

import ipaddress
import os
import re
import stat
from pathlib import Path

import httpx

# Name of the file; no other is read.
FILE = "local-token"
# Largest file that is read, in bytes.
MAX_BYTES = 256

_NAMED = re.compile(rb'\ABearer .*?local_token_file="((?:[^"\\]|\\.)*)"', re.DOTALL)


class NotUsedError(Exception):
    """Why the file that a server names is not used."""


def local_port(base: str) -> int | None:
    """The port of the server at this address, if it is on this machine."""
    try:
        url = httpx.URL(base)
    except httpx.InvalidURL:
        return None
    if not _is_loopback(url.host):
        return None
    return url.port or {"http": 80, "https": 443}.get(url.scheme)


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    mapped = getattr(address, "ipv4_mapped", None)
    return bool((mapped or address).is_loopback)


def named_file(response: httpx.Response) -> Path | None:
    """The file that a 401 names."""
    for name, value in response.headers.raw:
        found = _NAMED.match(value) if name.lower() == b"www-authenticate" else None
        if found is not None:
            return Path(os.fsdecode(re.sub(rb"\\(.)", rb"\1", found[1])))
    return None


def read(path: Path, port: int) -> str:
    """The token of the server on `port`."""
    if not path.is_absolute() or path.name != FILE:
        raise NotUsedError(f"{path} is no absolute path of a file `{FILE}`")
    try:
        # Not through a link, and nothing that blocks: looked at before it is opened, and again when it is open.
        _check(path, path.lstat())
        with path.open("rb") as file:
            _check(path, os.fstat(file.fileno()))
            text = file.read(MAX_BYTES).decode("ascii", "replace").strip()
    except OSError as error:
        raise NotUsedError(str(error)) from error
    if not re.fullmatch(rf"wmk_local-{port}_[A-Za-z0-9_-]{{43}}", text):
        raise NotUsedError(f"{path} holds no local token of the server on port {port}")
    return text


def _check(path: Path, found: os.stat_result) -> None:
    if not stat.S_ISREG(found.st_mode):
        raise NotUsedError(f"{path} is no regular file")
    if os.name == "posix":
        if found.st_uid != os.geteuid():
            raise NotUsedError(f"{path} belongs to another user")
        if found.st_mode & 0o077:
            raise NotUsedError(f"others may read {path}")
