"""Only who has the token is let in; other pages in the browser are not."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from mckibben.app.guard import Guard, new_token

TOKEN = "a-token-for-tests"
COOKIE = b"mckibben-token-8750"
KNOWN = (b"cookie", COOKIE + b"=" + TOKEN.encode())
OWN = [(b"host", b"127.0.0.1:8750"), KNOWN]


async def inner(scope: Any, receive: Any, send: Any) -> None:
    if scope["type"] == "http":
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"in"})
    else:
        await send({"type": "websocket.accept"})


def asked(
    headers: list[tuple[bytes, bytes]],
    *,
    host: str = "127.0.0.1",
    token: str = TOKEN,
    query: str = "",
    kind: str = "http",
) -> list[dict[str, Any]]:
    sent: list[dict[str, Any]] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": f"{kind}.connect"}

    scope = {"type": kind, "headers": headers, "query_string": query.encode()}
    asyncio.run(Guard(inner, host=host, port=8750, token=token)(scope, receive, send))
    return sent


def status(sent: list[dict[str, Any]]) -> int:
    return int(sent[0]["status"])


def test_who_knows_the_token_is_let_in() -> None:
    assert status(asked(OWN)) == 200
    assert status(asked([(b"host", b"localhost:1"), KNOWN])) == 200
    assert status(asked([(b"host", b"[::1]:1"), KNOWN])) == 200
    assert status(asked([(b"host", b"127.0.0.1:8750")])) == 403


@pytest.mark.parametrize("host", [b"evil.example", b"127.0.0.1.evil.example", b"", b"[::1", b"@"])
def test_other_hosts_are_not(host: bytes) -> None:
    """A name that an attacker points at this machine does not open it."""
    assert status(asked([(b"host", host), KNOWN])) == 403


def test_other_pages_are_not() -> None:
    foreign = [*OWN, (b"origin", b"http://evil.example")]
    assert status(asked(foreign)) == 403
    assert asked(foreign, kind="websocket") == [{"type": "websocket.close", "code": 1008}]
    own = [*OWN, (b"origin", b"http://127.0.0.1:8750")]
    assert status(asked(own)) == 200
    assert asked(own, kind="websocket") == [{"type": "websocket.accept"}]


def test_a_token_is_demanded() -> None:
    token, headers = new_token(), [(b"host", b"192.168.0.7:8750")]
    settings: dict[str, Any] = {"host": "0.0.0.0", "token": token}
    assert status(asked(headers, **settings)) == 403
    assert status(asked(headers, **settings, query="token=wrong")) == 403
    assert asked(headers, **settings, kind="websocket")[0]["type"] == "websocket.close"
    welcome = asked(headers, **settings, query=f"token={token}")
    assert status(welcome) == 200
    assert b'url=/"' in welcome[1]["body"]
    cookie = dict(welcome[0]["headers"])[b"set-cookie"]
    assert b"HttpOnly" in cookie
    assert b"SameSite=Strict" in cookie
    known = [*headers, (b"cookie", cookie.split(b";")[0])]
    assert status(asked(known, **settings)) == 200
    assert asked(known, **settings, kind="websocket") == [{"type": "websocket.accept"}]
    wrong = [*headers, (b"cookie", COOKIE + b"=guess")]
    assert status(asked(wrong, **settings)) == 403


def test_tokens_are_not_repeated() -> None:
    assert len({new_token() for _ in range(100)}) == 100
