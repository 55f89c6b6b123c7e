"""Who may talk to the workbench: a running server is asked as others would."""

from __future__ import annotations

import http.client
import socket
from collections.abc import Iterator
from dataclasses import dataclass
from http.client import HTTPMessage
from pathlib import Path

import pytest

from mckibben.app.guard import MOST_BODY_BYTES, MOST_HEAD_BYTES
from tests.app.browsing import Workbench, workbench


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workbench]:
    pytest.importorskip("nicegui")
    with workbench(tmp_path_factory.mktemp("guard")) as found:
        yield found


@dataclass
class Answer:
    status: int
    headers: HTTPMessage
    body: bytes


def ask(bench: Workbench, path: str = "/", **headers: str) -> Answer:
    connection = http.client.HTTPConnection("127.0.0.1", bench.port, timeout=30)
    connection.request("GET", path, headers=headers)
    found = connection.getresponse()
    answer = Answer(found.status, found.headers, found.read())
    connection.close()
    return answer


@pytest.fixture(scope="module")
def cookie(bench: Workbench) -> str:
    answer = ask(bench, bench.link.removeprefix(bench.address))
    given = answer.headers["set-cookie"]
    assert answer.status == 303
    assert "HttpOnly" in given
    assert "SameSite" in given
    assert ask(bench, bench.link.removeprefix(bench.address)).status == 403  # it is used up
    bench.link = bench.next_link()
    return given.partition(";")[0]


def test_nothing_is_answered_without_the_token(bench: Workbench, cookie: str) -> None:
    assert ask(bench, Cookie=cookie).status == 200
    for wrong in ("", f"{cookie}x", cookie.partition("=")[0] + "=", "a;;=b"):
        assert ask(bench, Cookie=wrong).status == 403
    assert ask(bench, "/_nicegui_ws/socket.io/?EIO=4&transport=polling").status == 403
    assert ask(bench, "/enter?key=wrong").status == 403


def test_it_listens_on_loopback_alone(bench: Workbench) -> None:
    listening = f":{bench.port:04X} 00000000:0000 0A "
    tables = [Path(f"/proc/net/{name}").read_text() for name in ("tcp", "tcp6")]
    (line,) = [one for table in tables for one in table.splitlines() if listening in one]
    assert line.split()[1].startswith("0100007F:")


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:{port}", "127.0.0.1.evil.example", "["]
)
def test_other_hosts_are_refused(bench: Workbench, cookie: str, host: str) -> None:
    assert ask(bench, Cookie=cookie, Host=host.format(port=bench.port)).status == 400


@pytest.mark.parametrize("origin", ["http://evil.example", "http://127.0.0.1:1", "null"])
def test_other_origins_are_refused(bench: Workbench, cookie: str, origin: str) -> None:
    assert ask(bench, Cookie=cookie, Origin=origin).status == 403
    assert ask(bench, Cookie=cookie, Origin=bench.address).status == 200


def test_heads_are_bounded_before_the_token(bench: Workbench) -> None:
    with socket.create_connection(("127.0.0.1", bench.port), timeout=30) as link:
        link.sendall(b"GET / HTTP/1.1\r\nX-Long: ")
        sent = 0
        try:
            while sent < 4 * MOST_HEAD_BYTES:
                link.sendall(b"a" * 4096)
                sent += 4096
            answer = link.recv(100)
        except OSError:  # hung up
            answer = b""
    assert answer == b"" or answer.startswith(b"HTTP/1.1 400")


def test_bodies_are_bounded(bench: Workbench, cookie: str) -> None:
    with socket.create_connection(("127.0.0.1", bench.port), timeout=30) as link:
        head = f"POST / HTTP/1.1\r\nHost: 127.0.0.1:{bench.port}\r\nCookie: {cookie}\r\n"
        link.sendall(f"{head}Content-Length: {MOST_BODY_BYTES + 1}\r\n\r\n".encode())
        assert link.recv(100).startswith(b"HTTP/1.1 413")


def test_files_of_the_folder_are_not_served(bench: Workbench, cookie: str) -> None:
    assert b"filelock" not in ask(bench, "/.owner", Cookie=cookie).body
    for path in ("/uploads/x.csv", "/..%2f..%2fetc/passwd", "//etc/passwd"):
        assert b"root:" not in ask(bench, path, Cookie=cookie).body
