"""Who may talk to the workbench: this machine alone, or whoever has the token.

Requests must name the host that the page is served from, so that a page of someone else's, opened in
the same browser, can neither read nor steer it; web sockets must come from the page itself.
"""

from __future__ import annotations

import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

LOCAL = ("127.0.0.1", "localhost", "::1")
COOKIE = "mckibben-token"


class Guard:
    """ASGI middleware that lets in or turns away.

    Parameters
    ----------
    app : callable
        What is behind it.
    host : str
        Address that the page is served on.
    token : str or None
        To be shown once as ``?token=``, then kept as a cookie; None where only this machine connects.
    """

    def __init__(self, app: Any, *, host: str, token: str | None) -> None:
        self.app, self.token = app, token
        self.hosts = None if host in ("0.0.0.0", "::") else {host, *LOCAL}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {
            key.decode("latin1").lower(): value.decode("latin1") for key, value in scope["headers"]
        }
        reason = self._objection(headers)
        if reason is None and self.token is not None and not self._knows(headers):
            given = parse_qs(scope.get("query_string", b"").decode("latin1")).get("token", [""])[0]
            if scope["type"] == "http" and secrets.compare_digest(given, self.token):
                await _answer(send, 303, "", self._welcome())
                return
            reason = (
                "This workbench wants its token: open the address that it printed when it started."
            )
        if reason is None:
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            await _answer(send, 403, reason, [])

    def _objection(self, headers: dict[str, str]) -> str | None:
        try:
            host = urlsplit(f"//{headers.get('host', '')}").hostname
        except ValueError:
            host = None
        if self.hosts is not None and host not in self.hosts:
            return "This address is not the workbench's."
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] != headers.get("host"):
            return "Another page may not use the workbench."
        return None

    def _knows(self, headers: dict[str, str]) -> bool:
        cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        return cookie is not None and secrets.compare_digest(cookie.value, self.token or "")

    def _welcome(self) -> list[tuple[bytes, bytes]]:
        kept = f"{COOKIE}={self.token}; HttpOnly; SameSite=Strict; Path=/"
        return [(b"set-cookie", kept.encode()), (b"location", b"/")]


async def _answer(send: Send, status: int, text: str, headers: list[tuple[bytes, bytes]]) -> None:
    plain = (b"content-type", b"text/plain; charset=utf-8")
    await send({"type": "http.response.start", "status": status, "headers": [plain, *headers]})
    await send({"type": "http.response.body", "body": text.encode()})


def new_token() -> str:
    """Return a token that cannot be guessed."""
    return secrets.token_urlsafe(24)
