"""Who may talk to the workbench: whoever came by its one-time link, and from its own page alone.

Other users of this machine reach its port too, and so do other pages in the same browser. The link is
used up when it is opened, and leaves a cookie. Hosts are checked by Starlette, heads by the server.
"""

from __future__ import annotations

import secrets
from collections.abc import Callable

from starlette.requests import HTTPConnection
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from mckibben.app.steps import LARGEST_UPLOAD

MOST_HEAD_BYTES = 2**16
"""Bytes of the head of a request, which the server bounds before anything here."""

MOST_BODY_BYTES = LARGEST_UPLOAD + 2**20
"""Bytes of the body of a request: of a file, and what is around it."""

HOSTS = ["127.0.0.1", "localhost"]

ENTER = "/enter"
"""Path of the one-time link."""


class Links:
    """The token, and the one-time link that gives it; the next is announced when one was used."""

    def __init__(self, address: str, announce: Callable[[str], None]) -> None:
        self.address, self.announce = address, announce
        self.token, self._key = secrets.token_urlsafe(32), secrets.token_urlsafe(32)

    @property
    def link(self) -> str:
        """The link that can be used now."""
        return f"{self.address}{ENTER}?key={self._key}"

    def use(self, key: str) -> bool:
        """Return whether a key is that of the link, which is then used up."""
        if not secrets.compare_digest(key.encode(), self._key.encode()):
            return False
        self._key = secrets.token_urlsafe(32)
        self.announce(self.link)
        return True


class Guard:
    """ASGI middleware; the port is in the cookie's name, as browsers send cookies to all ports."""

    def __init__(self, app: ASGIApp, *, port: int, links: Links) -> None:
        self.app, self.links, self.cookie = app, links, f"mckibben-{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it."""
        is_request = scope["type"] in ("http", "websocket")
        answer = self._answer(HTTPConnection(scope)) if is_request else None
        await (answer or self.app)(scope, receive, send)

    def _answer(self, request: HTTPConnection) -> Response | None:
        """Return the answer to a request that is not passed on."""
        host, token = request.headers["host"], request.cookies.get(self.cookie, "")
        if request.headers.get("origin", f"http://{host}") != f"http://{host}":
            return PlainTextResponse("Another page may not use the workbench.", 403)
        entering = request.url.path == ENTER
        if entering and self.links.use(request.query_params.get("key", "")):
            answer = RedirectResponse("/", 303)
            answer.set_cookie(self.cookie, self.links.token, httponly=True, samesite="lax")
            return answer
        if not secrets.compare_digest(token.encode(), self.links.token.encode()):
            text = "Open the workbench by the link that it printed last; each can be used once."
            return PlainTextResponse(text, 403)
        if entering:
            return RedirectResponse("/", 303)
        length = request.headers.get("content-length", "0")  # which the server holds clients to
        if int(length) > MOST_BODY_BYTES or "transfer-encoding" in request.headers:
            text = f"This is more than {LARGEST_UPLOAD // 2**20} MiB; use the command line."
            return PlainTextResponse(text, 413)
        return None
