"""Who may talk to the workbench: whoever has its token, from its own page, and never without end.

Other users of this machine reach its ports too, and so do the pages of others in the same browser: both
are told nothing and steer nothing without the token. It is the beginning of every path, and in no
cookie: browsers send those to whatever listens on another port. What goes out forbids all scripts but
its own.
"""

from __future__ import annotations

import hmac
import re
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any
from urllib.parse import urlsplit

from mckibben.errors import DataError

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
Headers = list[tuple[bytes, bytes]]

LOCAL = ("127.0.0.1", "localhost", "::1")

LARGEST_UPLOAD = 512 * 2**20
"""Bytes of a file."""

LARGEST_REQUEST = LARGEST_UPLOAD + 2**20
"""Bytes of a request: of a file, and what is around it."""

AT_ONCE = 2 * LARGEST_REQUEST
"""Bytes of all requests that are being received."""

TOKEN = re.compile(r"[A-Za-z0-9_.~-]{16,256}")
"""What a token may be: not guessed, and whole in an address."""

POLICY = "; ".join(
    (
        "default-src 'none'",
        # the page's frame compiles its templates in the browser, hence eval; no script stands in a page
        # or an attribute, except with the word that each answer makes up anew
        "script-src 'self' 'nonce-{nonce}' 'unsafe-eval'",
        "script-src-attr 'none'",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "object-src 'none'",
    )
)

PRECAUTIONS: Headers = [
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
]

HEARD: Headers = [(b"cross-origin-resource-policy", b"cross-origin")]
"""That there is an answer, and no more, is told to pages from elsewhere that have the token: one of them
waits for the workbench to start."""


class Guard:
    """ASGI middleware that lets in or turns away.

    Parameters
    ----------
    app : callable
        What is behind it.
    host : str
        Address that the page is served on.
    token : str
        Folder in which everything is served.
    """

    def __init__(self, app: Any, *, host: str, token: str) -> None:
        self.app, self.root = app, f"/{token}"
        self.hosts = None if host in ("0.0.0.0", "::") else {host, *LOCAL}
        self._receiving = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass a request on, or answer it."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers: Headers = [
            (key.lower(), value)
            for key, value in scope["headers"]
            if key.lower() != b"x-forwarded-prefix"  # which would go before the folder
        ]
        scope = {**scope, "headers": headers, "root_path": self.root}
        reason = self._objection(headers)
        if reason is None and not self._knows(scope):
            reason = (
                "This workbench wants its token: open the address that it printed when it started."
            )
        if reason is not None:
            await _refuse(scope, receive, send, 403, reason)
        elif _steered(scope, headers):
            await _refuse(scope, receive, send, 403, FOREIGN, HEARD)
        elif scope["type"] == "websocket":
            await self.app(scope, receive, send)
        else:
            await self._bounded(scope, headers, receive, send)

    def _objection(self, headers: Headers) -> str | None:
        given = _first(headers, b"host").decode("latin1")
        try:
            host = urlsplit(f"//{given}").hostname
        except ValueError:
            host = None
        if self.hosts is not None and host not in self.hosts:
            return "This address is not the workbench's."
        for name, value in headers:
            if name == b"origin" and value.decode("latin1").partition("://")[2] != given:
                return FOREIGN
        return None

    def _knows(self, scope: Scope) -> bool:
        """Tell whether what is asked for is in the folder that is named as the token."""
        folder = f"{self.root}/".encode()
        asked = str(scope.get("path", "")).encode("utf-8", "replace")[: len(folder)]
        return hmac.compare_digest(asked, folder)

    async def _bounded(self, scope: Scope, headers: Headers, receive: Receive, send: Send) -> None:
        """Pass a request on as long as it has no more bytes than allowed, and guard its answer."""
        told = _first(headers, b"content-length")
        if told and (not told.isdigit() or len(told) > 15 or int(told) > LARGEST_REQUEST):
            await _refuse(scope, receive, send, 413, TOO_LARGE)
            return
        received, over = 0, False

        async def counted() -> Message:
            nonlocal received, over
            message = await receive()
            if message["type"] == "http.request":
                received += len(message.get("body", b""))
                self._receiving += len(message.get("body", b""))
                over = over or received > LARGEST_REQUEST or self._receiving > AT_ONCE
            return {"type": "http.disconnect"} if over else message

        answer = _Answer(send)

        async def sent(message: Message) -> None:
            if not over:
                await answer(message)

        if not str(scope["path"]).startswith(f"{self.root}/_nicegui/"):
            # an answer with a page in it comes as it is, so that it can be amended
            headers = [header for header in headers if header[0] != b"accept-encoding"]
        try:
            await self.app({**scope, "headers": headers}, counted, sent)
        except Exception:
            if not over:
                raise
        finally:
            self._receiving -= received
        if over and not answer.begun:
            await _refuse(scope, receive, send, 413, TOO_LARGE)


FOREIGN = "Another page may not use the workbench."

TOO_LARGE = (
    f"This is more than {LARGEST_UPLOAD // 2**20} MiB, or too much is being sent at once: "
    "put large files into a folder and use the command line."
)


class _Answer:
    """What is sent, with precautions; scripts in a page get the word that lets them run."""

    def __init__(self, send: Send) -> None:
        self._send, self.begun = send, False
        self._nonce = secrets.token_urlsafe(18)
        self._page: tuple[Message, bytearray] | None = None

    async def __call__(self, message: Message) -> None:
        self.begun = True
        if message["type"] == "http.response.start":
            headers: Headers = list(message.get("headers", []))
            policy = POLICY.format(nonce=self._nonce).encode()
            message = {
                **message,
                "headers": [*headers, *PRECAUTIONS, (b"content-security-policy", policy)],
            }
            if _first(headers, b"content-type").startswith(b"text/html"):
                self._page = message, bytearray()
                return
        elif self._page is not None:
            start, page = self._page
            page += message.get("body", b"")
            if message.get("more_body"):
                return
            # whatever comes from files stands escaped in a page: these are its own scripts
            body = re.sub(
                rb"<script(?=[\s>])", b'<script nonce="%b"' % self._nonce.encode(), bytes(page)
            )
            kept = [item for item in start["headers"] if item[0].lower() != b"content-length"]
            length = (b"content-length", str(len(body)).encode())
            await self._send({**start, "headers": [*kept, length]})
            message = {"type": "http.response.body", "body": body}
        await self._send(message)


def _steered(scope: Scope, headers: Headers) -> bool:
    """Tell whether a page from elsewhere asks, and does more than lead a whole window here.

    The page that waits for the workbench to start is a file, which browsers take for elsewhere.
    """
    if _first(headers, b"sec-fetch-site") not in (b"cross-site", b"same-site"):
        return False
    led = (_first(headers, b"sec-fetch-mode"), _first(headers, b"sec-fetch-dest"))
    return scope.get("method") != "GET" or led != (b"navigate", b"document")


def _first(headers: Headers, name: bytes) -> bytes:
    return next((value for key, value in headers if key.lower() == name), b"")


async def _refuse(
    scope: Scope,
    receive: Receive,
    send: Send,
    status: int,
    reason: str,
    more: Headers | None = None,
) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
    else:
        plain = (b"content-type", b"text/plain; charset=utf-8")
        policy = (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'")
        length = (b"content-length", str(len(reason.encode())).encode())
        about = dict(
            [plain, (b"connection", b"close"), length, *PRECAUTIONS, policy, *(more or [])]
        )
        start = {"type": "http.response.start", "status": status}
        await send(start | {"headers": list(about.items())})
        await send({"type": "http.response.body", "body": reason.encode()})


def new_token() -> str:
    """Return a token that cannot be guessed."""
    return secrets.token_urlsafe(24)


def checked_token(token: str) -> str:
    """Return a token that was asked for.

    Raises
    ------
    DataError
        If it could be guessed, or would not be whole in an address.
    """
    if not TOKEN.fullmatch(token):
        raise DataError(
            "the token is empty, short, long or has other characters than an address takes",
            remedy="give 16 to 256 of A-Z a-z 0-9 _ . ~ -",
        )
    return token
