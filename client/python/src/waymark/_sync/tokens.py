# Made by tools/generate.py from _async/tokens.py. Do not edit.
"""Tokens, and who asks."""

from __future__ import annotations

from collections.abc import Iterable

from waymark._sync.base import Base
from waymark._values import present
from waymark.api import CreatedToken, PageLink, Role, Token, Whoami


class Tokens(Base):
    """Operations on tokens."""

    def create_token(
        self, name: str, role: Role, maps: Iterable[str] | None = None, valid_s: int | None = None
    ) -> CreatedToken:
        """Makes a token: for these maps or for all, valid for so many seconds or until it is revoked."""
        new = present(name=name, role=role, maps=None if maps is None else list(maps), valid_s=valid_s)
        return self._send(CreatedToken, "create_token", json=new)

    def tokens(self) -> tuple[Token, ...]:
        """All tokens by number, with those that were revoked or have expired."""
        return self._all(Token, "tokens")

    def revoke_token(self, token: int) -> None:
        """Revokes a token, with the sessions that it opened."""
        self._done("revoke_token", token)

    def whoami(self) -> Whoami:
        """Who asks, as the server sees it."""
        return self._send(Whoami, "whoami")

    def page_link(self) -> PageLink:
        """A link that opens the page once, with the rights of this client."""
        return self._send(PageLink, "page_link")
