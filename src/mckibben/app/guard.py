"""Who may talk to the workbench: whoever came by its one-time link, and from its own page alone.

Other users of this machine reach its port too, and so do other pages in the same browser. The link is
used up when it is opened, and leaves a cookie; hosts and origins are checked on every request.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

from mckibben.app.steps import LARGEST

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]

HEAD = 2**16
"""Bytes of the head of a request, which the server bounds before anything here."""

BODY = LARGEST + 2**20
"""Bytes of the body of a request: of a file, and what is around it."""

LOCAL = ("127.0.0.1", "localhost", "::1")

ENTER = "/enter"
"""Path of the one-time link."""

POLICY = "; ".join(
    [
        "default-src 'self' data: blob:",
        "script-src 'self' 'unsafe-inline' 'unsafe-eval'",  # as NiceGUI and Vue need them
        "style-src 'self' 'unsafe-inline'",
        "connect-src 'self' ws://127.0.0.1:{port} ws://localhost:{port}",
        "object-src 'none'",
        "base-uri 'none'",
        "form-action 'self'",
        "frame-ancestors 'none'",
    ]
)
"""What a page may load and ask: nothing of anybody else."""

PRECAUTIONS = {
    b"x-content-type-options": b"nosniff",
    b"x-frame-options": b"DENY",
    b"referrer-policy": b"no-referrer",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-origin",
}
"""Headers of every answer."""


class Guard:
    """ASGI middleware.

    Parameters
    ----------
    app : callable
        What is behind it.
    port : int
        Names the cookie: browsers send those of one port to all.
    links : Links
    """

    def __init__(self, app: Any, *, port: int, links: Links) -> None:
        self.app, self.links, self.cookie = app, links, f"mckibben-{port}"
        policy = {b"content-security-policy": POLICY.format(port=port).encode()}
        self.headers = PRECAUTIONS | policy

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or refuse it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        send = self._careful(send)
        headers = {
            key.decode("latin1").lower(): value.decode("latin1") for key, value in scope["headers"]
        }
        host = headers.get("host", "")
        if _host(host) not in LOCAL:
            await _answer(scope, receive, send, 403, "This address is not the workbench's.")
        elif headers.get("origin", f"//{host}").partition("//")[2] != host:
            await _answer(scope, receive, send, 403, "Another page may not use the workbench.")
        elif scope["type"] == "http" and scope["path"] == ENTER:
            await self._enter(scope, receive, send, headers)
        elif not self._knows(headers):
            text = "Open the workbench by the link that it printed last; each can be used once."
            await _answer(scope, receive, send, 403, text)
        elif not headers.get("content-length", "0").isdigit() or (
            int(headers.get("content-length", "0")[:15]) > BODY
        ):
            text = f"This is more than {LARGEST // 2**20} MiB; use the command line."
            await _answer(scope, receive, send, 413, text)
        else:
            await self.app(scope, _bounded(receive), send)

    def _careful(self, send: Send) -> Send:
        """Return what sends answers with the headers that are on all of them."""

        async def careful(message: Message) -> None:
            if message["type"] == "http.response.start":
                given = {key.lower() for key, _ in message["headers"]}
                kept = [one for one in message["headers"] if one[0].lower() not in self.headers]
                if b"cache-control" not in given:  # what never changes says so itself
                    kept.append((b"cache-control", b"no-cache"))
                message["headers"] = [*kept, *self.headers.items()]
            await send(message)

        return careful

    def _knows(self, headers: dict[str, str]) -> bool:
        try:
            found = SimpleCookie(headers.get("cookie", "")).get(self.cookie)
        except CookieError:
            return False
        return found is not None and hmac.compare_digest(
            found.value.encode(), self.links.token.encode()
        )

    async def _enter(
        self, scope: Scope, receive: Receive, send: Send, headers: dict[str, str]
    ) -> None:
        given = parse_qs(scope["query_string"].decode("latin1")).get("key", [""])[0]
        more = [(b"location", b"/")]
        if self.links.use(given):
            cookie = f"{self.cookie}={self.links.token}; HttpOnly; SameSite=Lax; Path=/"
            more.append((b"set-cookie", cookie.encode()))
        elif not self._knows(headers):
            await _answer(
                scope, receive, send, 403, "This link was used already; open the last one."
            )
            return
        await _answer(scope, receive, send, 303, "", more)


class Links:
    """The token, and the one-time link that gives it.

    Parameters
    ----------
    address : str
        Scheme, host and port.
    announce : callable
        Called with a link whenever the one before was used, and with the first.
    """

    def __init__(self, address: str, announce: Callable[[str], None]) -> None:
        self.address, self.announce = address, announce
        self.token, self._key = secrets.token_urlsafe(32), secrets.token_urlsafe(32)

    @property
    def link(self) -> str:
        """The link that can be used now."""
        return f"{self.address}{ENTER}?key={self._key}"

    def use(self, key: str) -> bool:
        """Return whether a key is that of the link, which is then used up."""
        if not hmac.compare_digest(key.encode(), self._key.encode()):
            return False
        self._key = secrets.token_urlsafe(32)
        self.announce(self.link)
        return True


def _host(given: str) -> str | None:
    try:
        return urlsplit(f"//{given}").hostname
    except ValueError:
        return None


def _bounded(receive: Receive) -> Receive:
    """Count the bytes of a body, and hang up when they are too many."""
    received = 0

    async def counted() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b"")) if message["type"] == "http.request" else 0
        return {"type": "http.disconnect"} if received > BODY else message

    return counted


async def _answer(
    scope: Scope,
    receive: Receive,
    send: Send,
    status: int,
    text: str,
    more: list[tuple[bytes, bytes]] | None = None,
) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    plain = [(b"content-type", b"text/plain; charset=utf-8"), (b"connection", b"close")]
    headers = [*plain, *(more or [])]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": text.encode()})
