# Made by tools/generate.py from _async/tokens.py. Do not edit.
"""Tokens, certificates of robots, and who asks."""

from __future__ import annotations

from collections.abc import Iterable

from waymark._sync.base import Base
from waymark._values import present
from waymark.api import CreatedToken, EnrolledRobot, PageLink, RobotCertificate, Role, Token, Whoami


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

    def enrol_robot(self, robot: str, request: str, valid_s: int | None = None) -> EnrolledRobot:
        """Has a robot's request (PKCS #10, PEM) signed, for so many seconds or a year: a certificate for encrypted
        connections. `waymark robot enrol` makes the key, the request and the robot's file in one step."""
        return self._send(EnrolledRobot, "enrol_robot", robot, json=present(request=request, valid_s=valid_s))

    def robot_certificates(self, robot: str) -> tuple[RobotCertificate, ...]:
        """A robot's certificates, the oldest first, with those that were revoked or have expired."""
        return self._all(RobotCertificate, "robot_certificates", robot)

    def revoke_robot_certificate(self, robot: str, serial: str) -> None:
        """Revokes a certificate: the robot's connection with it ends."""
        self._done("revoke_robot_certificate", robot, serial)

    def whoami(self) -> Whoami:
        """Who asks, as the server sees it."""
        return self._send(Whoami, "whoami")

    def page_link(self) -> PageLink:
        """A link that opens the page once, with the rights of this client."""
        return self._send(PageLink, "page_link")
