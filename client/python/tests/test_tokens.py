"""Claim: on the server's own machine a client finds its token by itself, and nothing else is read for it; tokens give
what their role allows and no more."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path

import httpx
import pictures
import pytest
from conftest import Server

from waymark import Image, MapClient, Refused
from waymark._local_token import NotUsedError, local_port, named_file, read

SECRET = ("a-_B" * 11)[:43]


def test_tokens_are_made_listed_and_revoked(server: Server) -> None:
    with server.maps() as maps:
        assert (maps.whoami().name, maps.whoami().role, maps.whoami().maps) == ("local", "admin", None)
        maps.create_map("tokens")
        made = maps.create_token("kim", "viewer", maps=["tokens"], valid_s=60)
        assert made.text.startswith(f"wmk_{made.token.id}_") and made.text not in repr(made)
        assert made.token in maps.tokens()
        with MapClient(server.http, token=made.text) as viewer:
            who = viewer.whoami()
            assert (who.name, who.role, who.maps, who.token) == ("kim", "viewer", ("tokens",), made.token.id)
            assert [each.name for each in viewer.maps()] == ["tokens"]
            with pytest.raises(Refused) as refused:
                viewer.create_map("other")
            assert (refused.value.code, refused.value.status) == ("forbidden", 403)
            assert refused.value.more["role"] == "operator"
            with pytest.raises(Refused) as hidden:
                viewer.map("taught")
            assert hidden.value.code == "unknown_map"
            link = viewer.page_link()
            opened = httpx.get(server.http + link.path, trust_env=False)
            assert opened.headers["location"] == "/" and link.path not in repr(link)
            maps.revoke_token(made.token.id)
            with pytest.raises(Refused) as revoked:
                viewer.maps()
            assert revoked.value.code == "unauthenticated" and "revoked" in revoked.value.detail
        maps.delete_map("tokens")
        newest = maps.audit(target="/tokens", most=2)
        assert [(each.action, each.actor) for each in newest] == [
            ("DELETE /tokens/{token}", "local"),
            ("POST /tokens", "local"),
        ]
        check = maps.check_audit()
        assert check.fault is None and maps.check_audit(check.head).fault is None
        noted = dataclasses.replace(check.head, sha256="0" * 64)
        assert maps.check_audit(noted).fault == f"entry {noted.seq} has another digest than was noted"
    with MapClient(server.http, token="wmk_1_x") as stranger, pytest.raises(Refused):
        stranger.maps()


def test_a_first_upload_and_a_first_stream_find_the_token(server: Server) -> None:
    with server.maps() as maps:
        maps.create_map("first")
    with server.maps() as maps, maps.live_events("first"):
        pass
    with server.maps() as maps:
        assert maps.recognise("first", Image.rgb(pictures.poster(0))).status == "no_match"
    with server.maps() as maps:
        maps.delete_map("first")


def test_a_file_that_is_no_private_local_token_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "local-token"

    def write(text: str, mode: int = 0o600) -> None:
        path.write_text(text)
        path.chmod(mode)

    write(f"wmk_local-80_{SECRET}\n")
    assert read(path, 80) == f"wmk_local-80_{SECRET}"
    for port, text, mode in [
        (81, f"wmk_local-80_{SECRET}", 0o600),
        (80, f"wmk_local-80_{SECRET}", 0o640),
        (80, f"wmk_local-80_{SECRET}a", 0o600),
        (80, "root:x:0:0", 0o600),
    ]:
        write(text, mode)
        with pytest.raises(NotUsedError):
            read(path, port)
    other = tmp_path / "other"
    path.rename(other)
    other.write_text(f"wmk_local-80_{SECRET}")
    path.symlink_to(other)
    for wrong in (other, path, Path("local-token"), tmp_path / "nothing" / "local-token"):
        with pytest.raises(NotUsedError):
            read(wrong, 80)
    if os.name == "posix":
        path.unlink()
        os.mkfifo(path)
        with pytest.raises(NotUsedError):
            read(path, 80)


def test_only_loopback_has_a_local_token() -> None:
    ports = {
        "http://127.0.0.1:8080": 8080,
        "http://localhost": 80,
        "https://[::1]": 443,
        "http://10.0.0.1:8080": None,
        "http://localhost.evil.example": None,
        "http://127.0.0.1@evil.example": None,
    }
    assert {base: local_port(base) for base in ports} == ports

    def named(challenge: str) -> Path | None:
        return named_file(httpx.Response(401, headers=[(b"WWW-Authenticate", challenge.encode())]))

    assert named(r'Bearer realm="waymark", local_token_file="/a \"b\\c/ä"') == Path('/a "b\\c/ä')
    assert named('Bearer realm="waymark"') is None and named('Basic local_token_file="/a"') is None
