"""Claim: whatever the OpenAPI document allows or forbids is answered as the document says: with a status that it
names, a body of its schema, and never with a failure of the server.

Schemathesis makes the requests, the same ones in every run: 6 valid and 6 invalid ones for each operation. More:

    WAYMARK_EXAMPLES=300 python -m pytest tests/test_schema.py
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pictures
import pytest
import schemathesis
from conftest import ROOT, serving
from hypothesis import HealthCheck, Phase, given, settings
from schemathesis import Case, GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.core.result import Ok
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
)

from waymark import MapClient, Refused
from waymark.api import WallBody

EXAMPLES = int(os.environ.get("WAYMARK_EXAMPLES", "6"))
CHECKS = [
    not_a_server_error,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]
SCHEMA = schemathesis.openapi.from_path(ROOT / "docs" / "openapi.json")
# What the response `default` names, for any request.
ANY_REQUEST = {400, 401, 403, 408, 429, 500, 503, 507}
# Streams of events do not end.
STREAMS = {"GET /api/v1/events", "GET /api/v1/maps/{map}/live", "GET /api/v1/jobs/{job}/events"}
OPERATIONS = {each.ok().label: each.ok() for each in SCHEMA.get_all_operations() if isinstance(each, Ok)}
MODES: tuple[Any, Any] = (GenerationMode.POSITIVE, GenerationMode.NEGATIVE)
# What is there; every other request is about it.
KNOWN: dict[str, str | int] = {"map": "hall", "landmark": "poster", "robot": "r1", "camera": "front"}


@schemathesis.serializer("application/zip")
def as_it_is(_context: schemathesis.SerializationContext, value: object) -> bytes:
    """What stands for a bundle: no zip, so each is refused."""
    return value if isinstance(value, bytes) else str(value).encode()


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str]]:
    """Address of a server of its own, and a token of an administrator that no request can revoke."""
    data: Path = tmp_path_factory.mktemp("schema")
    with serving(data) as server:
        yield server.http, (data / "local-token").read_text().strip()


def prepare(http: str, token: str) -> None:
    """Makes what is known, where a request has removed it."""
    with MapClient(http, token=token) as maps:
        try:
            maps.create_map("hall")
            maps.set_walls("hall", [WallBody((0.0, 0.0), (6.0, 0.0))])
            maps.upload_view("hall", "poster", pictures.teaching_photo(1), "whole_image", make_landmark=True)
        except Refused as refused:
            assert refused.code == "exists", refused
        maps.put_robot("r1", "hall")


@pytest.mark.parametrize("label", sorted(OPERATIONS.keys() - STREAMS))
def test_every_answer_is_as_the_document_says(service: tuple[str, str], label: str) -> None:
    http, token = service
    prepare(http, token)
    turn = itertools.count()

    def ask(case: Case[Any]) -> None:
        parameters: dict[str, Any] = case.path_parameters or {}
        if next(turn) % 2 == 0:
            parameters |= {name: value for name, value in KNOWN.items() if name in parameters}
            parameters |= {name: 1 for name in ("view", "job", "answer", "gathering", "token") if name in parameters}
        case.path_parameters = parameters
        response = case.call(base_url=http, headers={"Authorization": f"Bearer {token}"}, timeout=60)
        case.validate_response(response, checks=CHECKS)
        named = {int(status) for status in operation.definition.raw["responses"] if status != "default"}
        assert response.status_code in named | ANY_REQUEST, f"{label} does not name {response.status_code}"

    operation = OPERATIONS[label]
    # What takes nothing cannot be asked for in a wrong way.
    has_input = any((operation.path_parameters, operation.query, operation.headers, operation.body))
    for mode in MODES if has_input else MODES[:1]:
        limits = settings(
            max_examples=EXAMPLES,
            derandomize=True,
            database=None,
            deadline=None,
            phases=[Phase.explicit, Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        limits(given(operation.as_strategy(generation_mode=mode))(ask))()
    assert httpx.get(f"{http}/readyz", trust_env=False).status_code == 200
