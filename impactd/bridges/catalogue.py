"""One catalogue of many rigs: every stored shot with its modulus, in a Tiled server.

An entry's key is ``<rig>-000017``; its metadata is the API's answer for the shot, with the rig's
name and where the NeXus file can be fetched. A later fit or comparison replaces it, and Tiled keeps
the earlier one as a revision. Entries of all rigs lie side by side, as Tiled searches one level.
"""

from __future__ import annotations

import asyncio
import re
import sys
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

import anyio

from impactd.aliases import Json
from impactd.bridges.other_end import OtherEnd, Say
from impactd.bridges.place import Place
from impactd.bridges.webhook import FIRST_PAUSE_S, LONGEST_PAUSE_S
from impactd.client.async_rig import AsyncRig
from impactd.client.errors import LostError, RigError, UnreachableError
from impactd.client.shot import Shot

SPEC = "impactd-shot"
"""What Tiled is told that an entry is."""
ALL_AGAIN = "refit.done"
"""The event after which every shot may have another modulus."""
ONE_AGAIN = ("drop.stored", "fit.done", "shot.unlike")
_TRY_AGAIN = (409, 429)
"""Somebody made the entry in between; the server has too much to do."""
_LEFT_OUT = {"fits", "links", "repetitions"}
"""Large, or of the daemon's own paths; each is asked of the daemon."""


@dataclass
class Catalogue:
    """A Tiled server, as one rig writes to it.

    Attributes
    ----------
    url : str
        Of the server, or of a container in it.
    api_key : str
        One that may write.
    rig : str
        The name of the rig there.
    """

    url: str
    api_key: str
    rig: str
    _root: Any = None

    def register(self, shot: Shot, file: str) -> None:
        """Let a shot be there as it is now; ``file`` is where its NeXus file can be fetched.

        Raises
        ------
        RigError
            If another rig has the name, or the server refuses.
        httpx.HTTPError
            If the server does not answer, or not now.
        """
        from tiled.client import from_uri  # noqa: PLC0415 - an extra, slow to load
        from tiled.client.utils import ClientError  # noqa: PLC0415 - as above

        key = re.sub(r"[^\w.-]+", "-", self.rig) + f"-{shot.number:06d}"
        told = {"rig": self.rig, "file": file, **shot.model_dump(mode="json", exclude=_LEFT_OUT)}
        try:
            self._root = self._root or from_uri(self.url, api_key=self.api_key)
            self._write(key, told)
        except ClientError as error:
            code = error.response.status_code
            if code in _TRY_AGAIN or code >= 500:
                raise
            raise RigError(f"the catalogue refuses: {error}") from error

    def _write(self, key: str, told: Json) -> None:
        try:
            entry = self._root[key]
        except KeyError:
            self._root.create_container(key, metadata=told, specs=[SPEC])
            return
        known = dict(entry.metadata)
        if known.get("sha256") != told["sha256"]:
            raise RigError(
                f"{key} in the catalogue is another recording: another rig is called "
                f"{self.rig!r} there. Give this one a name of its own with --name."
            )
        if known != told:
            entry.replace_metadata(told)


async def carry(
    rig: AsyncRig,
    catalogue: Catalogue,
    place: Place,
    say: Say,
    *,
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
) -> None:
    """Keep a rig's shots in a catalogue until cancelled.

    Parameters
    ----------
    place : Place
        Behind which event it begins; without one every stored shot is registered first. It moves on
        when the catalogue has taken what the event is about.
    say : callable
        Takes a sentence when the catalogue or the daemon is away, and when it is back.
    sleep : callable, optional
        Waits between attempts.

    Raises
    ------
    RigError
        If tiled is not installed, the token is not valid, the catalogue refuses, or another rig has
        the name.

    Notes
    -----
    What a catalogue does not take is sent again after 1, 2, 4, ... 300 seconds, and what is behind
    it waits: the daemon keeps the events. Registering twice changes nothing.
    """
    try:
        import tiled.client  # noqa: F401, PLC0415 - an extra
    except ImportError as error:
        raise RigError("this needs tiled: pip install 'impactd[bridges]'.") from error
    there = OtherEnd(f"The catalogue {catalogue.url}", say)
    daemon = OtherEnd("The daemon", say)
    while True:
        try:
            await rig.status()
            daemon.is_there()
            await _session(rig, catalogue, place, there, sleep)
        except (LostError, UnreachableError) as error:
            daemon.is_away(error)
            await sleep(FIRST_PAUSE_S)  # it comes back


async def _session(
    rig: AsyncRig,
    catalogue: Catalogue,
    place: Place,
    there: OtherEnd,
    sleep: Callable[[float], Awaitable[None]],
) -> None:
    async def register(shot: Shot) -> None:
        """Register one shot, again and again until it is taken."""
        import httpx  # noqa: PLC0415 - what tiled's client asks with

        file, pause_s = f"{rig.connection.url}/v1/shots/{shot.number}.h5", FIRST_PAUSE_S
        while True:
            try:
                await anyio.to_thread.run_sync(catalogue.register, shot, file)
            except httpx.HTTPError as error:
                there.is_away(error)
                await sleep(pause_s)
                pause_s = min(2 * pause_s, LONGEST_PAUSE_S)
            else:
                there.is_there()
                return

    async def register_all() -> None:
        """Register every shot."""
        async for shot in rig.shots(sys.maxsize):
            await register(shot)

    if place.last is None:
        newest = await rig.connection.newest_event()
        await register_all()
        place.arrived(newest)
    async for event in rig.events(place.last):
        if event.kind == ALL_AGAIN:
            await register_all()
        elif event.kind in ONE_AGAIN:
            number = event.data.get("shot", event.data.get("number"))
            if number is not None:  # a joint fit is of no shot
                await register(await rig.shot(int(number)))
        place.arrived(event.id)
