"""The workbench answers nobody but its user, and a received folder leads nowhere and runs nothing."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path
from typing import Any
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest

from mckibben import DataError, Recording
from mckibben.app import guard
from mckibben.app.guard import Guard, checked_token, new_token
from mckibben.app.jobs import Jobs
from mckibben.app.workspace import Workspace
from tests.app.browsing import workbench

TOKEN = "a-token-of-tests"
HOST = b"127.0.0.1:8750"

posix = pytest.mark.skipif(os.name != "posix", reason="rights and locks of POSIX")

Header = tuple[bytes, bytes]


def asked(
    *headers: Header,
    host: bytes = HOST,
    path: str = f"/{TOKEN}/",
    kind: str = "http",
    method: str = "GET",
    bound: str = "127.0.0.1",
    body: list[bytes] | None = None,
    page: bytes = b"in",
) -> tuple[int, dict[bytes, bytes], bytes, int]:
    """Ask a guard, and return status, headers and content of the answer, and the parts it read.

    A websocket that is let in has the status 200, one that is closed 403.
    """
    parts = list(body or [b""])
    sent: list[Any] = []

    async def receive() -> Any:
        if kind == "websocket":
            return {"type": "websocket.connect"}
        part = parts.pop(0) if parts else b""
        return {"type": "http.request", "body": part, "more_body": bool(parts)}

    async def send(message: Any) -> None:
        sent.append(message)

    async def inner(scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "websocket":
            await send({"type": "websocket.accept"})
            return
        while (message := await receive())["type"] == "http.request" and message["more_body"]:
            pass
        if message["type"] == "http.disconnect":
            raise ConnectionError
        about = [(b"content-type", b"text/html"), (b"content-length", b"2")]
        await send({"type": "http.response.start", "status": 200, "headers": about})
        await send({"type": "http.response.body", "body": page})

    scope = {"type": kind, "method": method, "path": path, "headers": [(b"host", host), *headers]}
    before = len(parts)
    asyncio.run(Guard(inner, host=bound, token=TOKEN)(scope, receive, send))
    if kind == "websocket":
        (only,) = sent
        return (200 if only == {"type": "websocket.accept"} else 403), {}, b"", 0
    return sent[0]["status"], dict(sent[0]["headers"]), sent[1]["body"], before - len(parts)


# Who is answered ------------------------------------------------------------------------------


CROSS = {b"sec-fetch-site": b"cross-site"}
WINDOW = {**CROSS, b"sec-fetch-mode": b"navigate", b"sec-fetch-dest": b"document"}
"""Of a page elsewhere that leads a window here, which it may do by GET."""

FOREIGN: list[tuple[dict[bytes, bytes], dict[str, Any], int]] = [
    *(({}, {"host": name}, 200) for name in (HOST, b"localhost:1", b"[::1]:1")),
    *(
        ({}, {"host": name}, 403)
        for name in (b"evil.example", b"127.0.0.1.evil.example", b"", b"[::1", b"@")
    ),
    ({b"origin": b"http://evil.example"}, {}, 403),
    ({b"origin": b"http://" + HOST}, {}, 200),
    (CROSS, {}, 403),
    ({b"sec-fetch-site": b"same-site"}, {}, 403),
    ({b"sec-fetch-site": b"same-origin"}, {}, 200),
    ({b"cookie": b'a="unclosed; \xff=' + b"y" * 70_000}, {}, 200),
    (WINDOW, {"kind": "http"}, 200),
    (WINDOW, {"kind": "http", "method": "POST"}, 403),
    ({**WINDOW, b"sec-fetch-dest": b"iframe"}, {}, 403),
    ({**WINDOW, b"sec-fetch-mode": b"no-cors"}, {}, 403),
]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(("headers", "options", "status"), FOREIGN)
def test_foreign_names_and_pages_are_not_answered_with_the_token_either(
    headers: dict[bytes, bytes], options: dict[str, Any], status: int, kind: str
) -> None:
    assert asked(*headers.items(), **{"kind": kind, **options})[0] == status


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(("bound", "host"), [("127.0.0.1", HOST), ("0.0.0.0", b"192.168.0.7:8750")])
def test_who_lacks_the_token_is_not_answered(bound: str, host: bytes, kind: str) -> None:
    assert asked(host=host, bound=bound, kind=kind)[0] == 200
    assert asked(host=host, bound=bound, kind=kind, path=f"/{TOKEN}/_nicegui/x.js")[0] == 200
    strange = ("/", "", "/ü" + TOKEN, "/\udcff\0", f"/?token={TOKEN}", f"/{TOKEN}", f"//{TOKEN}/")
    for path in (*strange, f"/{TOKEN.upper()}/", f"/{TOKEN[:-1]}/", f"/{new_token()}/"):
        assert asked(host=host, bound=bound, kind=kind, path=path)[0] == 403
    forwarded = (b"x-forwarded-prefix", f"/{TOKEN}".encode())
    for header in (forwarded, (b"cookie", TOKEN.encode())):
        assert asked(header, host=host, bound=bound, kind=kind, path="/")[0] == 403


@pytest.mark.parametrize("token", ["", " ", " " * 20, "short", "ü" * 20, "a;b" * 9, "a" * 300])
def test_a_token_that_could_be_guessed_or_broken_is_refused(token: str) -> None:
    with pytest.raises(DataError, match="token"):
        checked_token(token)
    assert len({new_token() for _ in range(100)}) == 100


# Nothing runs --------------------------------------------------------------------------------


def test_a_page_runs_its_own_scripts_alone_and_sets_no_cookie() -> None:
    page = b'<head><script type="module">1</script></head>'
    status, headers, content, _ = asked(page=page)
    policy = headers[b"content-security-policy"].decode()
    (scripts,) = (part for part in policy.split("; ") if part.startswith("script-src "))
    assert "unsafe-inline" not in scripts
    assert "frame-ancestors 'none'" in policy
    nonce = scripts.partition("'nonce-")[2].partition("'")[0]
    assert content == page.replace(b"<script", b'<script nonce="%b"' % nonce.encode())
    assert (status, int(headers[b"content-length"])) == (200, len(content))
    assert asked(page=page)[1][b"content-security-policy"].decode() != policy
    assert b"set-cookie" not in headers


# What is received ------------------------------------------------------------------------------


def recording() -> Recording:
    t = np.arange(50) * 0.1
    return Recording({"pressure": 2 + np.sin(t), "displacement": 10 + np.cos(t)}, 0.1)


def test_a_body_has_a_largest_size(monkeypatch: pytest.MonkeyPatch) -> None:
    for length in (str(3 * 2**29).encode(), b"-1", b"9" * 5000, b"ten"):
        status, _, _, read = asked((b"content-length", length), body=[b"x"] * 9)
        assert (status, read) == (413, 0)
    monkeypatch.setattr(guard, "LARGEST_REQUEST", 1000)
    assert asked(body=[b"x" * 100] * 500)[0] == 413  # without a length it is counted
    assert asked(body=[b"x" * 100] * 9)[0] == 200


@pytest.mark.parametrize("name", ["runs.zip", "runs.tar.gz", "runs.csv.ZIP", "x.py", "x"])
def test_archives_and_programs_are_refused_and_not_kept(name: str, tmp_path: Path) -> None:
    with pytest.raises(DataError):
        Workspace(tmp_path).keep_upload(name, b"PK")
    assert not list((tmp_path / "uploads").iterdir())


@posix
def test_links_in_a_received_folder_lead_nowhere(tmp_path: Path) -> None:
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "file").write_text("mine")
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "uploads").symlink_to(victim)
    with pytest.raises(DataError):
        Workspace(tmp_path / "a")
    workspace = Workspace(tmp_path / "b")
    (tmp_path / "b" / "log.jsonl").symlink_to(victim / "file")
    (tmp_path / "b" / "models" / "x.json").symlink_to(victim / "file")
    with pytest.raises(DataError):
        workspace.log("`touch pwned`")
    with pytest.raises(DataError):
        workspace.path("models", "x.json")
    workspace.claim()
    assert (victim / "file").read_text() == "mine"


# Others on this machine -----------------------------------------------------------------------


@posix
def test_the_second_workbench_on_a_folder_reads_only(tmp_path: Path) -> None:
    first, second = Workspace(tmp_path), Workspace(tmp_path)
    assert first.claim()
    assert not second.claim()
    first.add(recording(), origin="", call="", name="run")
    for change in (
        lambda: second.add(recording(), origin="", call=""),
        lambda: second.remove("run"),
        lambda: second.keep_upload("a.csv", b"1"),
        lambda: Jobs(second).submit("fit", {"model": "pi", "name": "pi"}),
        lambda: second.new_path("takeaway", "x.json"),
    ):
        with pytest.raises(DataError):
            change()
    assert len(second.with_role("train")) == 1


# The server itself ------------------------------------------------------------------------------


@pytest.mark.long
def test_a_served_workbench_answers_by_its_token_alone(tmp_path: Path) -> None:
    pytest.importorskip("nicegui")
    with workbench(tmp_path / "ws") as address:
        origin, token = address.rstrip("/").rsplit("/", 1)
        for path in ("/", "/_nicegui/static/nicegui.js", "/docs", "/favicon.ico"):
            for way in (origin, f"{origin}/{new_token()}"):
                with pytest.raises(HTTPError) as caught:
                    urlopen(way + path)
                with caught.value as answer:
                    assert answer.code == 403
        with urlopen(f"{origin}/{token}/") as page:
            assert "'nonce-" in page.headers["content-security-policy"]
            assert page.headers["set-cookie"] is None
