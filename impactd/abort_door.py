"""An abort path that shares nothing with the rest: a Unix socket with its own threads.

::

    client:  abort ab
    answer:  {"aborted": true, "drop": 17, "sentence": "...", "took_ms": 9.1, "safe_after_ms": 9.8}

It asks neither the event loop nor the database, and no token: whoever may open the socket file may
abort. `impactd abort` comes here first; HTTP is the second way.
"""

from __future__ import annotations

import json
import os
import selectors
import socket
import stat
import struct
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import structlog

if TYPE_CHECKING:  # the client needs the paths only, and at once
    from impactd.acquisition.service import AcquisitionService
    from impactd.api.arrivals import Arrivals

SYSTEM_FOLDER = Path("/run/impactd")
"""The `RuntimeDirectory` of the shipped unit."""
_MOST = 16
_LIMIT_S = 1.0
_LONGEST_LINE = 256
_HINT = b"Say `abort NAME` and a line feed; see `impactd abort --help`.\n"
_log = structlog.get_logger("impactd.abort_door")


def socket_name(port: int) -> str:
    """Return the name of the socket file of the daemon that listens on a TCP port."""
    return f"abort-{port}.sock"


def private_folder() -> Path:
    """Return where the socket is when the system has no folder for it."""
    # Not TMPDIR: daemon and client may have different ones.
    return Path("/tmp") / f"impactd-{os.geteuid()}"  # noqa: S108 - used only if `is_private`


def is_private(folder: Path) -> bool:
    """Return whether a folder is this user's and closed to all others."""
    try:
        found = folder.lstat()
    except OSError:
        return False
    own = found.st_uid == os.geteuid()
    return stat.S_ISDIR(found.st_mode) and own and not found.st_mode & 0o077


def _folders() -> Iterator[Path]:
    """Yield where this process may put its socket, the best place first."""
    given = os.environ.get("RUNTIME_DIRECTORY", "").partition(":")[0]
    if given:
        yield Path(given)
    session = os.environ.get("XDG_RUNTIME_DIR")
    for folder in (*([Path(session) / "impactd"] if session else []), private_folder()):
        try:
            folder.mkdir(mode=0o700, exist_ok=True)
        except OSError:
            continue
        if is_private(folder):
            yield folder


@dataclass
class _Visitor:
    """A client whose line has not arrived yet."""

    began_s: float = field(default_factory=time.monotonic)
    said: bytes = b""


class AbortDoor:
    """The socket and its threads.

    ``arrivals`` refuses what the event loop reads too late. Clients find the socket by the daemon's
    TCP ``port``; ``path`` is set once it is open.
    """

    def __init__(self, service: AcquisitionService, arrivals: Arrivals, port: int) -> None:
        self._service = service
        self._arrivals = arrivals
        self._port = port
        self.path: Path | None = None
        self._inode = 0
        self._listener: socket.socket | None = None
        self._visitors: dict[socket.socket, _Visitor] = {}  # oldest first
        self._answering = threading.Semaphore(_MOST)
        self._workers = ThreadPoolExecutor(_MOST, thread_name_prefix="abort")
        self._wake, self._woken = socket.socketpair()
        self._thread = threading.Thread(target=self._serve, name="abort-door", daemon=True)

    def start(self) -> None:
        """Open the socket; without a place for it HTTP stays the only way, and the log says so."""
        for folder in _folders():
            try:
                self._open(folder / socket_name(self._port))
            except OSError as error:
                _log.warning("no abort socket here", folder=str(folder), why=str(error))
            else:
                self._thread.start()
                return
        _log.error("there is no abort socket; `impactd abort` needs HTTP", port=self._port)

    def stop(self) -> None:
        """Close the socket and remove its file; safe to call twice."""
        if self._listener is None:
            return
        self._wake.send(b"x")
        self._thread.join(timeout=5.0)
        self._workers.shutdown(wait=True)
        for one in (self._listener, self._wake, self._woken, *self._visitors):
            one.close()
        self._listener = None
        if self.path is not None and _inode_of(self.path) == self._inode:
            self.path.unlink(missing_ok=True)

    def __enter__(self) -> AbortDoor:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _open(self, path: Path) -> None:
        _remove_stale(path)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM | socket.SOCK_NONBLOCK)
        try:
            listener.bind(str(path))
            path.chmod(0o660)  # before anybody can connect
            # A client whose connection finds no room here is refused at once, so there is much.
            listener.listen(socket.SOMAXCONN)
        except OSError:
            listener.close()
            raise
        self.path, self._inode, self._listener = path, _inode_of(path), listener

    # The thread

    def _serve(self) -> None:
        assert self._listener is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self._listener, selectors.EVENT_READ)
            selector.register(self._woken, selectors.EVENT_READ)
            while True:
                for key, _ in selector.select(self._until_next_s()):
                    found = key.fileobj
                    assert isinstance(found, socket.socket)
                    if found is self._woken:
                        return
                    try:
                        if found is self._listener:
                            self._let_in(selector)
                        elif found in self._visitors:
                            self._listen_to(found, selector)
                    except OSError:  # whoever came has gone
                        self._close(found, selector)
                self._close_the_slow(selector)

    def _until_next_s(self) -> float | None:
        first = next(iter(self._visitors.values()), None)
        if first is None:
            return None
        return max(0.0, first.began_s + _LIMIT_S - time.monotonic())

    def _let_in(self, selector: selectors.BaseSelector) -> None:
        assert self._listener is not None
        visitor, _ = self._listener.accept()
        visitor.setblocking(False)
        if len(self._visitors) >= _MOST:
            self._close(next(iter(self._visitors)), selector)
        self._visitors[visitor] = _Visitor()
        selector.register(visitor, selectors.EVENT_READ)

    def _listen_to(self, visitor: socket.socket, selector: selectors.BaseSelector) -> None:
        heard = self._visitors[visitor]
        more = visitor.recv(_LONGEST_LINE)
        heard.said += more
        line, end, _ = heard.said.partition(b"\n")
        if more and not end and len(line) < _LONGEST_LINE:
            return
        selector.unregister(visitor)
        del self._visitors[visitor]
        word, _, name = line.decode("utf-8", "replace").strip().partition(" ")
        if word != "abort" or not end:
            with visitor:
                if more:
                    visitor.send(_HINT)
            return
        # Beyond so many at once the next one waits here; each takes a tenth of a second.
        self._answering.acquire()
        self._workers.submit(self._answer, visitor, _who(visitor, name), time.monotonic())

    def _close(self, visitor: socket.socket, selector: selectors.BaseSelector) -> None:
        if self._visitors.pop(visitor, None) is not None:
            selector.unregister(visitor)
            visitor.close()

    def _close_the_slow(self, selector: selectors.BaseSelector) -> None:
        now_s = time.monotonic()
        for visitor, heard in list(self._visitors.items()):
            if now_s - heard.began_s >= _LIMIT_S:
                self._close(visitor, selector)

    # An abort

    def _answer(self, visitor: socket.socket, who: str, received_s: float) -> None:
        try:
            with visitor:
                said = self._abort(who, received_s)
                visitor.settimeout(_LIMIT_S)
                visitor.sendall(said.encode() + b"\n")
        except OSError:
            _log.warning("whoever aborted did not wait for the answer", by=who)
        except Exception:  # he hears nothing and tries HTTP
            _log.exception("an abort failed", by=who)
        finally:
            self._answering.release()

    def _abort(self, who: str, received_s: float) -> str:
        self._arrivals.begin()
        try:
            began_s = time.monotonic()
            report = self._service.abort(by=who)
        finally:
            in_time = self._arrivals.settle_from_thread()
        if not in_time:
            _log.warning("the web server did not come round; it refuses what it reads until then")
        return json.dumps(
            {
                "aborted": report.aborted,
                "drop": report.drop,
                "sentence": report.sentence,
                "took_s": report.took_s,
                "took_ms": 1e3 * (began_s - received_s + report.took_s),
                "safe_after_ms": 1e3 * (time.monotonic() - received_s),
            }
        )


def _who(visitor: socket.socket, name: str) -> str:
    """Return the name a client gave, as far as it can be printed, and the user it runs as."""
    size = struct.calcsize("3i")
    _, uid, _ = struct.unpack("3i", visitor.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size))
    printable = "".join(one for one in name if one.isprintable())[:64].strip()
    return f"{printable or 'somebody'} (uid {uid})"


def _remove_stale(path: Path) -> None:
    """Remove the socket file of a daemon that is dead; raise `OSError` where one lives."""
    if not path.is_socket():
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(_LIMIT_S)
        try:
            probe.connect(str(path))
        except ConnectionRefusedError:
            path.unlink(missing_ok=True)
            return
    raise OSError(f"another daemon answers at {path}")


def _inode_of(path: Path) -> int:
    try:
        return path.lstat().st_ino
    except OSError:
        return 0
