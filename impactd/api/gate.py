"""The outermost layer of the API: refusals before a request reaches a route.

Host name, body size and content type are checked here; security headers are added to every
answer; an error answer that is not a problem document yet becomes one; and an exception nobody
caught becomes a problem with a reference into the log instead of a traceback.
"""

from __future__ import annotations

import re
import secrets
import time
from collections.abc import Callable, Sequence

import anyio
import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from impactd.api.audit import WRITES, Written
from impactd.api.problems import MEDIA_TYPE, ProblemError, from_status

MAX_BODY_BYTES = 64 * 1024
MAX_UPLOAD_BYTES = 32 * 1024 * 1024
"""Of a recording. Derived: 1.3 s at 1 MHz as text of two columns and seven digits have 27 MiB."""
UPLOAD_TYPE = "application/octet-stream"
_UPLOADS = re.compile(r"/v1/recordings/[^/]+/(files/[^/]+|drops)")
"""Where a `PUT` brings a file as it is; no form of another site can send `UPLOAD_TYPE`."""
_METHODS_WITH_BODY = frozenset({"POST", "PUT", "PATCH", "DELETE"})
_SECURITY_HEADERS = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "content-security-policy": "default-src 'none'; frame-ancestors 'none'",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
# Headers of a framework's error answer that still mean something on the problem.
_KEPT = ("allow", "content-range", "retry-after", "www-authenticate")

Observer = Callable[[Scope, int, float], None]
Recorder = Callable[[Written], None]
_log = structlog.get_logger("impactd.api")


def host_name(header: str) -> str:
    """Return the host of a ``Host`` header without its port, in lower case.

    ``"localhost:8642"`` gives ``"localhost"``, ``"[::1]:8642"`` gives ``"[::1]"``.
    """
    text = header.strip().lower()
    if text.startswith("["):
        address, bracket, _ = text.partition("]")
        return address + bracket
    return text.partition(":")[0]


class Gate:
    """ASGI layer around the whole application.

    Parameters
    ----------
    allowed_hosts : sequence of str
        Host names the daemon answers to, without port; against DNS rebinding.
    observe : callable
        Called with scope, status and seconds once per answered request.
    record : callable
        Called in a thread with every write, after its answer has gone out.
    """

    def __init__(
        self,
        app: ASGIApp,
        *,
        allowed_hosts: Sequence[str],
        observe: Observer,
        record: Recorder,
        max_body_bytes: int = MAX_BODY_BYTES,
    ) -> None:
        self._app = app
        self._hosts = frozenset(name.lower() for name in allowed_hosts)
        self._observe = observe
        self._record = record
        # A disk that hangs holds these threads and none that answers.
        self._recorders = anyio.CapacityLimiter(2)
        self._max_body_bytes = max_body_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, whatever error occurs."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        reply = _Reply(scope, send, self._observe)
        scope.setdefault("state", {})
        try:
            self._check(scope)
            await self._app(scope, self._counted(receive, self._most_bytes(scope)), reply.send)
        except ProblemError as problem:
            await reply.problem(problem, receive)
        except Exception as error:  # the last defence: a sentence for the person, the rest logged
            if reply.started and _reader_is_gone(error):
                return
            reference = secrets.token_hex(4)
            _log.exception("request failed", reference=reference, path=scope["path"])
            await reply.problem(
                ProblemError(
                    "internal",
                    f"The daemon failed while it answered; reference {reference}.",
                    reference=reference,
                ),
                receive,
            )
        if scope["method"] in WRITES and reply.started:
            written = Written(scope, reply.status, reply.location)
            await anyio.to_thread.run_sync(self._record, written, limiter=self._recorders)

    def _check(self, scope: Scope) -> None:
        headers = Headers(scope=scope)
        hosts = headers.getlist("host")
        if len(hosts) != 1 or host_name(hosts[0]) not in self._hosts:
            name = ", ".join(hosts) or "(none)"
            raise ProblemError("host-not-allowed", f"The request names the host {name!r}.")
        length = headers.get("content-length", "0")
        if not length.isascii() or not length.isdigit():
            raise ProblemError("bad-request", f"Content-Length is {length!r}.")
        if int(length) > self._most_bytes(scope):
            raise _too_large(int(length), self._most_bytes(scope))
        has_body = int(length) > 0 or "transfer-encoding" in headers
        if has_body and scope["method"] in _METHODS_WITH_BODY:
            kind = headers.get("content-type", "").partition(";")[0].strip().lower()
            # of another method than PUT the router says that there is none
            if kind != "application/json" and not (_takes_files(scope) and kind == UPLOAD_TYPE):
                raise ProblemError(
                    "media-type",
                    f"The body has the content type {kind or '(none)'!r}.",
                    remedy=f"Send `Content-Type: {UPLOAD_TYPE}`." if _is_upload(scope) else "",
                )

    def _most_bytes(self, scope: Scope) -> int:
        return MAX_UPLOAD_BYTES if _is_upload(scope) else self._max_body_bytes

    def _counted(self, receive: Receive, most_bytes: int) -> Receive:
        """Count the bytes that arrive: a chunked body has no length to check beforehand."""
        total = 0

        async def counted() -> Message:
            nonlocal total
            message = await receive()
            total += len(message.get("body", b""))
            if total > most_bytes:
                raise _too_large(total, most_bytes)
            return message

        return counted


def _is_upload(scope: Scope) -> bool:
    return scope["method"] == "PUT" and _takes_files(scope)


def _takes_files(scope: Scope) -> bool:
    return _UPLOADS.fullmatch(scope["path"]) is not None


def _too_large(size: int, most_bytes: int) -> ProblemError:
    return ProblemError(
        "body-too-large",
        f"The body has {size} bytes or more; at most {most_bytes} are read.",
        headers={"Connection": "close"},
        limit_bytes=most_bytes,
    )


class _Reply:
    """One answer on its way out."""

    def __init__(self, scope: Scope, send: Send, observe: Observer) -> None:
        self._scope = scope
        self._send = send
        self._observe = observe
        self._began_s = time.perf_counter()
        self.started = False
        self.status = 0
        self.location: str | None = None
        self._foreign: ProblemError | None = None

    async def send(self, message: Message) -> None:
        """Pass one ASGI message on, or replace a foreign error answer."""
        if message["type"] == "http.response.start":
            headers = MutableHeaders(raw=message["headers"])
            if message["status"] >= 400 and headers.get("content-type") != MEDIA_TYPE:
                kept = {name: headers[name] for name in _KEPT if name in headers}
                self._foreign = from_status(message["status"], "The request was refused.", kept)
                return
            await self._start(message, headers)
        elif self._foreign is not None:
            if not message.get("more_body", False):
                foreign, self._foreign = self._foreign, None
                await foreign.response()(self._scope, _no_body, self.send)
        else:
            await self._send(message)

    async def _start(self, message: Message, headers: MutableHeaders) -> None:
        for name, value in _SECURITY_HEADERS.items():
            headers.setdefault(name, value)
        message["headers"] = headers.raw
        self.started = True
        self.status = message["status"]
        self.location = headers.get("location")
        self._observe(self._scope, message["status"], time.perf_counter() - self._began_s)
        await self._send(message)

    async def problem(self, problem: ProblemError, receive: Receive) -> None:
        """Answer with a problem, unless an answer has begun already."""
        if not self.started:
            await problem.response()(self._scope, receive, self.send)


def _reader_is_gone(error: BaseException) -> bool:
    """A stream whose reader closed the connection ends in broken pipes: that is no failure."""
    if isinstance(error, BaseExceptionGroup):
        return all(_reader_is_gone(one) for one in error.exceptions)
    return isinstance(error, (anyio.BrokenResourceError, anyio.ClosedResourceError, OSError))


async def _no_body() -> Message:
    return {"type": "http.disconnect"}
