"""``impactd doctor``: what is well, what is not, and how to mend it."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from analysis.written_numbers import counted
from impactd.console import doctor_checks, doctor_rescue
from impactd.console.doctor_checks import Finding
from impactd.console.failure import Failure, sentence
from impactd.console.options import settings_of
from impactd.console.tables import paint, print_json

if TYPE_CHECKING:
    from impactd.settings.settings import Settings

_SHOT_BYTES = 1_000_000
"""A stored shot of 0.4 s at 1 MS/s, generously. [byte]"""


def run(config: Path | None, data: Path | None, *, as_json: bool) -> None:
    """Look at everything a daemon needs and print what was found.

    Parameters
    ----------
    config, data : Path or None
        As given on the command line.
    as_json : bool
        Print the findings as JSON.

    Raises
    ------
    Failure
        If anything is not well.
    """
    found = []
    for finding in examine(config, data):
        found.append(finding)
        if not as_json:
            light = paint("ok  ", "green") if finding.well else paint("BAD ", "red")
            print(f"{light} {finding.name}: {finding.said}")
            if finding.mend:
                print(f"     -> {finding.mend}")
    if as_json:
        print_json([asdict(finding) for finding in found])
    bad = [finding.name for finding in found if not finding.well]
    if bad:
        raise Failure(f"{len(bad)} of {len(found)} checks failed: {', '.join(bad)}.")


def examine(config: Path | None, data: Path | None) -> Iterator[Finding]:
    """Yield one finding after the other; without settings nothing else can be looked at.

    Parameters
    ----------
    config, data : Path or None
        As given on the command line.

    Yields
    ------
    Finding
        In the order in which they should be mended.
    """
    yield doctor_checks.python()
    there = doctor_checks.packages()
    yield there
    if not there.well:
        return  # every other check would only stumble over what is missing
    yield doctor_checks.compiled_code()
    try:
        settings = settings_of(config, data)
    except Exception as error:  # each check reports what it met, whatever it was
        said = sentence(error).removeprefix("impactd: ")
        mend = (
            "Name a settings file with --config FILE."
            if "cannot be read" in said
            else "Correct the named key; config/rig.toml explains every key."
        )
        yield Finding("configuration", False, said, mend)
        return
    kind = "simulated" if settings.simulated else "real"
    yield Finding(
        "configuration", True, (f"rig {settings.rig.name!r} ({kind}) is completely described")
    )
    for name, check in _CHECKS.items():
        try:
            yield from check(settings)
        except Exception as error:  # as above
            remedy = getattr(error, "remedy", "") or (
                "Correct what the sentence names, then run this again."
            )
            said = sentence(error).removeprefix("impactd: ")
            yield Finding(name, False, said, remedy)


def _materials(settings: Settings) -> Iterator[Finding]:
    from impactd.settings.materials import load_materials

    materials = load_materials(settings.materials.file)
    said = f"{len(materials.spheres)} spheres, {len(materials.surfaces)} surfaces"
    yield Finding("materials", True, f"{said} in {settings.materials.file}")


def _directory(settings: Settings) -> Iterator[Finding]:
    directory = settings.storage.directory
    if not directory.exists():
        parent = next(part for part in directory.absolute().parents if part.exists())
        well = os.access(parent, os.W_OK)
        mend = "" if well else f"Create {directory} and give it to the daemon's user."
        yield Finding("data directory", well, f"{directory} does not exist yet", mend)
        return
    well = os.access(directory, os.R_OK | os.W_OK | os.X_OK)
    mend = "" if well else f"sudo chown -R {os.getuid()} {directory}, or run as its owner."
    said = f"{directory} can{'' if well else 'not'} be written by user {os.getuid()}"
    yield Finding("data directory", well, said, mend)


def _disk(settings: Settings) -> Iterator[Finding]:
    directory = settings.storage.directory.absolute()
    place = directory if directory.exists() else next(p for p in directory.parents if p.exists())
    free, reserve = shutil.disk_usage(place).free, settings.storage.reserve_bytes
    shots = max(0, (free - reserve) // _SHOT_BYTES)
    room = counted(shots, "shot")
    said = f"{free / 1e9:.1f} GB free, reserve {reserve / 1e9:.1f} GB, room for {room}"
    mend = "" if shots else "Free space, or lower storage.reserve_bytes."
    yield Finding("disk", shots > 0, said, mend)


def _devices(settings: Settings) -> Iterator[Finding]:
    """Open the devices; the valve goes to its safe state. A running daemon is asked instead."""
    from impactd.data_lock import DataLock, DataLockedError

    try:
        lock = DataLock(settings.storage.directory)
    except DataLockedError as error:
        yield _daemon(str(error.holder.get("url") or ""))
        return
    with lock:
        from drivers.errors import DriverError
        from impactd.rig.build import build_rig
        from impactd.settings.materials import load_materials

        rig = build_rig(settings, load_materials(settings.materials.file))
        try:
            for name, device in (("digitizer", rig.digitizer), ("valve", rig.valve)):
                try:
                    device.ensure_ready()
                except DriverError as error:
                    said = f"{error.what} {error.why}".strip()
                    mend = error.remedy or "Check power and cable, then run this again."
                    yield Finding(name, False, said, mend)
                else:
                    yield Finding(name, True, f"answers: {device.identity}")
        finally:
            rig.close()


def _daemon(url: str) -> Finding:
    from impactd.client.connection import Connection

    with Connection(url, timeout_s=5.0) as client:
        status = client.get("/v1/status")
    mend = "" if status["ready"] else "Do what the sentence says."
    return Finding("daemon", bool(status["ready"]), f"runs at {url}: {status['sentence']}", mend)


_CHECKS: dict[str, Callable[[Settings], Iterator[Finding]]] = {
    "materials": _materials,
    "data directory": _directory,
    "disk": _disk,
    "rescue directory": doctor_rescue.rescue_directory,
    "index": doctor_checks.index,
    "tokens": doctor_checks.tokens,
    "port": doctor_checks.port,
    "environment": doctor_checks.environment,
    "devices": _devices,
}
