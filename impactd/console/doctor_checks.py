"""What an installation needs beside its rig; each check asks the thing itself."""

# ruff: noqa: PLC0415 - imported when a check runs: a missing package must not hide the others

from __future__ import annotations

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from impactd.settings.settings import Settings

_LEAST_PYTHON = (3, 11)
_COMPILED = Path(__file__).resolve().parents[2] / "analysis" / "model"
"""Where numba keeps what it compiled, unless told otherwise."""


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    well : bool
        Whether it is as it should be.
    said : str
        What was found, with values and units.
    mend : str
        What to do; empty when all is well.
    """

    name: str
    well: bool
    said: str
    mend: str = ""


def python() -> Finding:
    """Return whether Python is new enough."""
    version = ".".join(str(part) for part in sys.version_info[:3])
    well = sys.version_info[:2] >= _LEAST_PYTHON
    mend = "" if well else "Install Python 3.11 or newer, then make a new virtual environment."
    return Finding("python", well, f"{version} at {sys.executable}", mend)


def packages() -> Finding:
    """Return whether all packages are there, each new enough for this program."""
    from packaging.requirements import Requirement

    again = f"In a checkout: {sys.executable} -m pip install --upgrade ."
    try:
        wanted = metadata.requires("impactd") or []
    except metadata.PackageNotFoundError:
        return Finding("packages", False, "impactd itself is not installed here", again)
    bad, count = [], 0
    for line in wanted:
        need = Requirement(line)
        if need.marker is not None and not need.marker.evaluate({"extra": ""}):
            continue
        count += 1
        try:
            found = metadata.version(need.name)
        except metadata.PackageNotFoundError:
            bad.append(f"{need.name} is missing")
        else:
            if not need.specifier.contains(found, prereleases=True):
                bad.append(f"{need.name} is {found}, needed is {need.specifier}")
    if bad:
        return Finding("packages", False, "; ".join(bad), again)
    return Finding("packages", True, f"all {count} are installed and new enough")


def compiled_code() -> Finding:
    """Return whether compiled code can be kept; without that nothing can be fitted."""
    name = "compiled code"
    told = os.environ.get("NUMBA_CACHE_DIR")
    if told:
        well = _writable(Path(told))
        mend = "" if well else f"Create {told} for this user, or set NUMBA_CACHE_DIR elsewhere."
        said = f"NUMBA_CACHE_DIR {told} can{'' if well else 'not'} be written"
        return Finding(name, well, said, mend)
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser())
    for place in (_COMPILED / "__pycache__", home / "numba"):
        if _writable(place):
            return Finding(name, True, f"is kept in {place}")
    said = f"neither {_COMPILED} nor {home} can be written by user {os.getuid()}"
    return Finding(name, False, said, "Set NUMBA_CACHE_DIR to a folder of this user.")


def _writable(place: Path) -> bool:
    """Return whether a folder is there and writable, or could be made."""
    there = next(part for part in (place, *place.absolute().parents) if part.exists())
    return os.access(there, os.W_OK | os.X_OK)


def port(settings: Settings) -> Iterator[Finding]:
    """Say whether the daemon can listen where the settings say; a running one may do so already."""
    from impactd.data_lock import read_holder

    server = settings.server
    at = f"{server.host}:{server.port}"
    try:
        family = socket.getaddrinfo(server.host, server.port, type=socket.SOCK_STREAM)[0][0]
        socket.create_server((server.host, server.port), family=family).close()
    except OSError as error:
        ours = read_holder(settings.storage.directory).get("url") or ""
        if str(ours).endswith(f":{server.port}"):
            yield Finding("port", True, f"{at} is the daemon's own")
            return
        yield Finding(
            "port",
            False,
            f"the daemon cannot listen at {at}: {error.strerror or error}",
            f"Stop what uses it (`ss -ltnp 'sport = :{server.port}'`), or change server.port.",
        )
    else:
        yield Finding("port", True, f"{at} is free")


def index(settings: Settings) -> Iterator[Finding]:
    """Say whether the archive's index opens and is consistent.

    Yields
    ------
    Finding
        One.
    """
    import sqlite3

    from impactd.storage.archive import INDEX_NAME

    file = settings.storage.directory / INDEX_NAME
    if not file.exists():
        yield Finding("index", True, "there is no archive yet; the first start makes it")
        return
    mend = "Stop the daemon, then run `impactd reindex`: it rebuilds the index from the shot files."
    try:
        with closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as base:
            (said,) = base.execute("PRAGMA quick_check(1)").fetchone()
    except sqlite3.Error as error:
        yield Finding("index", False, f"{file} is damaged: {error}", mend)
        return
    well = said == "ok"
    said = f"{file} holds together" if well else f"{file} is damaged: {said}"
    yield Finding("index", well, said, "" if well else mend)


def environment(settings: Settings) -> Iterator[Finding]:
    """Say what the settings' way to temperature and humidity brings now.

    Yields
    ------
    Finding
        What was found; nothing where the settings name no way.
    """
    from impactd.acquisition.environment_reading import EnvironmentReading

    if settings.environment is None:
        return
    with EnvironmentReading(settings.environment, None) as reading:
        while not reading.wait(1.0):
            continue
        found, unknown = reading.result()
    if unknown is not None:
        yield Finding("environment", False, unknown.reason.removesuffix("."), unknown.remedy)
        return
    assert found is not None
    said = []
    if found.temperature_c is not None:
        said.append(f"{found.temperature_c.value:.3g} degC (u {found.temperature_c.u:.2g} K)")
    if found.relative_humidity is not None:
        share, u = found.relative_humidity.value, found.relative_humidity.u
        said.append(f"{100 * share:.3g} % relative humidity (u {100 * u:.2g} %)")
    yield Finding("environment", True, ", ".join(said))


def tokens(settings: Settings) -> Iterator[Finding]:
    """Say whether a valid token may move the rig, and whether the one at hand may.

    Yields
    ------
    Finding
        One on the stored tokens, and one on the user's own.
    """
    from impactd.client.environment import token_from_environment
    from impactd.storage.archive import Archive
    from impactd.storage.timestamp import utc_now

    make = "impactd token create --scope operate --name YOU"
    storage = settings.storage
    with Archive.open(storage.directory, reserve_bytes=storage.reserve_bytes) as archive:
        usable = [
            token
            for token in archive.tokens.list()
            if token.allows("operate")
            and token.revoked_utc is None
            and (token.expires_utc is None or token.expires_utc > utc_now())
        ]
        secret = token_from_environment()
        mine = archive.tokens.check(secret) if secret else None
    said = f"{len(usable)} valid with scope operate or more"
    yield Finding("tokens", bool(usable), said, "" if usable else make)
    if not secret:
        return
    if mine is None:
        said = "IMPACTD_TOKEN is unknown here, revoked or expired; or --data is another archive"
        yield Finding("your token", False, said, f"export IMPACTD_TOKEN=$({make})")
    else:
        yield Finding("your token", True, f"is {mine.name!r} with scope {mine.scope}")
