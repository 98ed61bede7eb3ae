# Made by tools/generate.py from _async/audit.py. Do not edit.
"""The audit log."""

from __future__ import annotations

from waymark._http import query_of
from waymark._sync.base import Base
from waymark.api import AuditCheck, AuditEntry, AuditHead


class Audit(Base):
    """Operations on the audit log."""

    def audit(
        self,
        *,
        actor: str | None = None,
        target: str | None = None,
        since_ms: int | None = None,
        before_ms: int | None = None,
        most: int = 1000,
    ) -> tuple[AuditEntry, ...]:
        """The newest changes first, `most` of them: those by tokens with the name `actor` (or the `server`), to what
        begins with `target` (`/maps/office`), from `since_ms` until before `before_ms`, ms since the Unix epoch."""
        query = {"actor": actor, "target": target, "since_ms": since_ms, "before_ms": before_ms}
        return self._first(most, AuditEntry, "audit", **query)

    def check_audit(self, noted: AuditHead | None = None) -> AuditCheck:
        """Whether the audit log is as it was written. `noted`: an earlier `AuditCheck.head`, kept outside of the
        server, which has to be there still."""
        head = {} if noted is None else {"seq": noted.seq, "sha256": noted.sha256}
        return self._send(AuditCheck, "check_audit", params=query_of(head))
