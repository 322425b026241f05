"""HEAD and ETags for every JSON answer: an unchanged one is a 304 without a body.

A route that tags its own answer (shot files, moduli) is left alone. Nothing else passes through
here but GET and HEAD, so that no request to move waits for it.
"""

from __future__ import annotations

import hashlib

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

_OWN_HEAD = ".h5"
"""Shot files answer HEAD themselves: their length is known without reading them."""
_DIGEST_BYTES = 16


class Conditional:
    """ASGI layer that answers HEAD as GET without its body, and tags JSON."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http" or scope["method"] not in {"GET", "HEAD"}:
            await self._app(scope, receive, send)
            return
        head = scope["method"] == "HEAD" and not scope["path"].endswith(_OWN_HEAD)
        inner = {**scope, "method": "GET"} if head else scope
        await self._app(inner, receive, _Tagged(scope, send, head=head).send)


class _Tagged:
    """One answer on its way out."""

    def __init__(self, scope: Scope, send: Send, *, head: bool) -> None:
        self._known = Headers(scope=scope).get("if-none-match", "")
        self._send = send
        self._head = head
        self._start: Message | None = None
        self._parts: list[bytes] = []
        self._held = False

    async def send(self, message: Message) -> None:
        """Hold JSON until it is whole; pass everything else on as it comes."""
        if message["type"] == "http.response.start":
            headers = Headers(raw=message["headers"])
            kind = headers.get("content-type", "").partition(";")[0]
            self._held = (
                message["status"] == 200 and kind == "application/json" and "etag" not in headers
            )
            self._start = message
            if not self._held:
                await self._send(message)
            return
        if message["type"] != "http.response.body" or not self._held:
            await self._send(
                {**message, "body": b""} if self._head and "body" in message else message
            )
            return
        self._parts.append(message.get("body", b""))
        if not message.get("more_body", False):
            await self._finish(b"".join(self._parts))

    async def _finish(self, body: bytes) -> None:
        assert self._start is not None
        tag = f'"{hashlib.blake2b(body, digest_size=_DIGEST_BYTES).hexdigest()}"'
        headers = MutableHeaders(raw=list(self._start["headers"]))
        headers["etag"] = tag
        known = [one.strip().removeprefix("W/") for one in self._known.split(",")]
        status = self._start["status"]
        if tag in known or "*" in known:
            status, body = 304, b""
            del headers["content-length"]
            del headers["content-type"]
        await self._send({**self._start, "status": status, "headers": headers.raw})
        await self._send({"type": "http.response.body", "body": b"" if self._head else body})
