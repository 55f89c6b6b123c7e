"""Only who has the token is let in; other pages in the browser are not."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import Any

import pytest

from mckibben.app.door import door
from mckibben.app.guard import Guard, new_token
from mckibben.app.server import _without
from mckibben.app.workspace import Workspace

TOKEN = "a-token-for-tests"
OWN = [(b"host", b"127.0.0.1:8750")]


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
    path: str | None = None,
    kind: str = "http",
) -> list[dict[str, Any]]:
    sent: list[dict[str, Any]] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": f"{kind}.connect"}

    scope = {"type": kind, "headers": headers, "path": f"/{token}/" if path is None else path}
    asyncio.run(Guard(inner, host=host, token=token)(scope, receive, send))
    return sent


def status(sent: list[dict[str, Any]]) -> int:
    return int(sent[0]["status"])


def test_who_knows_the_token_is_let_in() -> None:
    assert status(asked(OWN)) == 200
    assert status(asked([(b"host", b"localhost:1")])) == 200
    assert status(asked([(b"host", b"[::1]:1")])) == 200
    assert status(asked(OWN, path="/")) == 403


@pytest.mark.parametrize("host", [b"evil.example", b"127.0.0.1.evil.example", b"", b"[::1", b"@"])
def test_other_hosts_are_not(host: bytes) -> None:
    """A name that an attacker points at this machine does not open it."""
    assert status(asked([(b"host", host)])) == 403


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
    for path in ("/", "", f"/{token[:-1]}/", f"/{token}", f"/{new_token()}/", f"//{token}/"):
        assert status(asked(headers, **settings, path=path)) == 403
        (closed,) = asked(headers, **settings, path=path, kind="websocket")
        assert closed["type"] == "websocket.close"
    for path in (f"/{token}/", f"/{token}/_nicegui/x.js"):
        assert status(asked(headers, **settings, path=path)) == 200
    assert asked(headers, **settings, kind="websocket") == [{"type": "websocket.accept"}]


def test_no_cookie_is_set_nor_looked_at() -> None:
    """Browsers send cookies to all ports of a machine, whoever listens there."""
    answer = asked([*OWN, (b"cookie", b'a="unclosed; \xff=' + b"y" * 70_000)])
    assert status(answer) == 200
    assert b"set-cookie" not in dict(answer[0]["headers"])
    assert status(asked([*OWN, (b"cookie", TOKEN.encode())], path="/")) == 403


def test_the_page_that_leads_in_goes_with_the_workbench(tmp_path: Path) -> None:
    folder = tmp_path / "<script>alert(1)<"
    folder.mkdir()
    address = f"http://127.0.0.1:8750/{TOKEN}/"
    with door(folder, 8750, address) as page:
        assert page is not None
        text = page.read_text()
        assert address in text
        assert "<script>alert" not in text
    assert not page.exists()
    (folder / ".open-8750.html").write_text("of a workbench that was killed")
    assert Workspace(folder).claim()
    assert not list(folder.glob(".open-*"))


def test_what_is_left_out_at_the_start_can_be_loaded_later() -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == "wave"]:
        del sys.modules[name]
    with _without("wave"), pytest.raises(ImportError):
        __import__("wave")
    assert __import__("wave").open
