"""Temperature and humidity at a drop, from the technician or from the settings' source.

::

    preparation of a drop ── enter ──> thread: read the file, or run the command
                          ── wait(), result() ──> an Environment, or why there is none
                          ── leave ──> the command is killed; also on an abort

A reading never stops a drop and never invents a number. The drop's own thread only checks whether
it is there, for as long as the settings allow; a file or a command that hangs blocks no drop.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from analysis.campaign import Environment
from impactd.storage.errors import CampaignError
from impactd.storage.json_fields import Fields, parse_json
from impactd.storage.materials_json import ENVIRONMENT_KEYS, environment_from_json
from impactd.storage.regular_file import open_regular_file
from impactd.storage.timestamp import utc_at

if TYPE_CHECKING:
    from impactd.settings.sections import EnvironmentSection

# Two quantities take a hundred bytes; whoever keeps notes beside them still has room.
_MOST_BYTES = 64 * 1024
# A local file of that size is read within a millisecond; one that takes longer hangs.
_FILE_LIMIT_S = 1.0
_LOOK_EVERY_MS = 50


@dataclass(frozen=True)
class Unknown:
    """Why there is no reading, with a remedy."""

    reason: str
    remedy: str


class _NoReadingError(Exception):
    """There is no reading; the message says why."""


class EnvironmentReading:
    """One reading, made while a drop is prepared.

    ``section`` is the source that the settings name. ``stated`` is what the technician read; only
    what is missing there is read.
    """

    def __init__(self, section: EnvironmentSection | None, stated: Environment | None) -> None:
        self._stated = stated or Environment()
        whole = None not in (self._stated.temperature_c, self._stated.relative_humidity)
        self._section = None if whole else section
        self._found: Environment | None = None
        self._why_not = ""
        self._done = threading.Event()
        self._hook: _Hook | None = None
        self._ends_s = 0.0

    def __enter__(self) -> EnvironmentReading:
        """Begin to read; return at once."""
        section = self._section
        if section is None or section.is_constant:
            self._found = None if section is None else section.constant()
            self._done.set()
            return self
        self._hook = None if section.command is None else _Hook(section.command)
        limit_s = _FILE_LIMIT_S if section.command is None else section.command_limit_s
        self._ends_s = time.monotonic() + limit_s
        self._why_not = f"{self._said()} did not answer within {limit_s:g} s"
        try:
            threading.Thread(target=self._read, name="environment", daemon=True).start()
        except RuntimeError as error:
            self._why_not = f"{self._said()} cannot be read: {error}"
            self._done.set()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End a command that still runs; wait for nothing."""
        if self._hook is not None:
            self._hook.stop()

    def wait(self, limit_s: float) -> bool:
        """Return whether the reading, or its time, is over; wait for at most so long. [s]"""
        left_s = self._ends_s - time.monotonic()
        return self._done.wait(max(0.0, min(limit_s, left_s))) or left_s <= 0

    def result(self) -> tuple[Environment | None, Unknown | None]:
        """Return what is known, and why not more where more was asked for.

        Both are there once `wait` said that it is over.
        """
        done = self._done.is_set()  # asked once: it may come true in any moment
        found = self._stated.completed_by(self._found if done else None)
        known = None if found == Environment() else found
        if done and not self._why_not:
            return known, None
        return known, Unknown(f"{self._why_not}.", self._remedy())

    def _said(self) -> str:
        section = self._section
        assert section is not None
        if section.command is not None:
            return f"environment.command ({section.command[0]})"
        return f"environment.file ({section.file})"

    def _remedy(self) -> str:
        if self._hook is not None:
            return (
                "Run the command by hand, as the daemon's user; its stderr is in the daemon's "
                "log. Until it works, give the reading with the drop."
            )
        return (
            "Check that the sensor's program runs and may write the file. Until it does, give "
            "the reading with the drop."
        )

    def _read(self) -> None:
        try:
            found = self._looked_up()
        except _NoReadingError as error:
            why_not = f"{self._said()} {error}"
        except Exception as error:  # whatever it is, it must not stop the drop
            why_not = f"{self._said()} cannot be read: {error}"
        else:
            self._found, why_not = found, ""
        self._why_not = why_not
        self._done.set()

    def _looked_up(self) -> Environment:
        section = self._section
        assert section is not None
        if self._hook is not None:
            return _parsed(self._hook.run(), "the command")
        assert section.file is not None
        assert section.max_age_s is not None
        return _parsed(_fresh(section.file, section.max_age_s), str(section.file))


def _fresh(path: Path, max_age_s: float) -> bytes:
    """Return the content of a file that was written recently."""
    try:
        with open_regular_file(path, _MOST_BYTES) as file:
            written_s = os.fstat(file.fileno()).st_mtime
            content = file.read(_MOST_BYTES)
    except OSError as error:
        raise _NoReadingError(f"cannot be read: {error.strerror}") from error
    age_s = time.time() - written_s
    if age_s > max_age_s:
        raise _NoReadingError(
            f"is stale: it was last written at {utc_at(written_s)}, more than max_age_s = "
            f"{max_age_s:g} s ago"
        )
    # After the clock was set back, a file that nobody writes any more would look fresh for long.
    if age_s < -max_age_s:
        raise _NoReadingError(f"was last written at {utc_at(written_s)}, which is in the future")
    return content


def _parsed(content: bytes, file: str) -> Environment:
    """Return the values of a sensor's JSON, validated like those of a campaign."""
    try:
        fields = Fields(parse_json(content, file), file=file, known=ENVIRONMENT_KEYS)
        found = environment_from_json(fields)
    except CampaignError as error:
        raise _NoReadingError(
            f"is not plausible: {error.json_path} {error.reason.rstrip('.')}"
        ) from error
    if found is None:
        raise _NoReadingError(f"is not usable: it has neither {' nor '.join(ENVIRONMENT_KEYS)}")
    return found


class _Hook:
    """A command that prints a reading; killed with all its children when it is over."""

    def __init__(self, command: tuple[str, ...]) -> None:
        self._command = command
        self._stopped = threading.Event()
        self._ending = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None

    def run(self) -> bytes:
        """Return what the command prints; returns early once it is stopped."""
        # Popen holds the interpreter until the program is loaded. From a network disk that could
        # hang, and an abort with it; the shell is on the local disk, and hangs by itself.
        by_shell = ("/bin/sh", "-c", 'exec "$@"', "sh", *self._command)
        try:
            process = subprocess.Popen(  # noqa: S603 - what the settings name
                by_shell,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                start_new_session=True,  # so that its children can be killed with it
            )
        except OSError as error:
            raise _NoReadingError(f"cannot be started: {error.strerror}") from error
        self._process = process
        if self._stopped.is_set():
            self._kill()
        content = self._printed(process)
        if len(content) > _MOST_BYTES:
            self._kill()
        # Looked at without being reaped: until then nobody else can have its number.
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        self._kill()
        with self._ending:
            status = process.wait()
        if len(content) > _MOST_BYTES:
            raise _NoReadingError(f"printed more than {_MOST_BYTES} bytes")
        if status:
            ended = f"exit status {status}" if status > 0 else f"signal {-status}"
            raise _NoReadingError(f"failed with {ended}")
        return content

    def _printed(self, process: subprocess.Popen[bytes]) -> bytes:
        """Return what comes out until it ends, is too much, or is stopped."""
        assert process.stdout is not None
        content = b""
        with process.stdout as out:
            ready = select.poll()
            ready.register(out, select.POLLIN)
            # Not read to the end at once: a grandchild in a session of its own may keep it open.
            while len(content) <= _MOST_BYTES and not self._stopped.is_set():
                if ready.poll(_LOOK_EVERY_MS):
                    part = os.read(out.fileno(), _MOST_BYTES)
                    if not part:
                        break
                    content += part
        return content

    def stop(self) -> None:
        """Kill the command, running or about to be started; never waits for it."""
        self._stopped.set()
        self._kill()

    def _kill(self) -> None:
        process = self._process
        if process is None:
            return
        with self._ending:
            if process.returncode is None:
                with suppress(ProcessLookupError, PermissionError):
                    os.killpg(process.pid, signal.SIGKILL)
