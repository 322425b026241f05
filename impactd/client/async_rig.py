"""A rig, for programs with an event loop."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from types import TracebackType
from typing import TYPE_CHECKING, Any

import anyio

from impactd.aliases import Json
from impactd.client import asking, talk
from impactd.client.async_connection import AsyncConnection
from impactd.client.connection import Connection
from impactd.client.environment import address, token_from_environment
from impactd.client.errors import RigError
from impactd.client.events import Event
from impactd.client.runs import READY_WITHIN_S
from impactd.client.shot import Shot
from impactd.client.talk import Tell, fresh_key, silent
from impactd.wire.answers import FitJobAnswer
from impactd.wire.rig_answers import (
    AbortAnswer,
    CalibrationAnswer,
    DiagnosisAnswer,
    StatusAnswer,
)

if TYPE_CHECKING:
    import xarray


class AsyncRig:
    """A rig and its daemon; the methods of `Rig`, awaited.

    Parameters
    ----------
    url : str, optional
        The daemon's address; without it IMPACTD_URL, or where it listens by default.
    token : str, optional
        A bearer token; without it IMPACTD_TOKEN, or the file that IMPACTD_TOKEN_FILE names.
    operator : str, optional
        Who hangs the spheres; your login name.
    progress : callable, optional
        Is told how far a wait is: a text, and a share or ``None``.
    timeout_s : float, optional
        Longest wait for one answer. [s]
    """

    def __init__(
        self,
        url: str | None = None,
        token: str | None = None,
        *,
        operator: str | None = None,
        progress: Tell | None = None,
        timeout_s: float = 30.0,
    ) -> None:
        known = token or token_from_environment()
        self.connection = AsyncConnection(address(url), known, timeout_s=timeout_s)
        # h5py reads where it likes, so a record is read in a thread, through a line of its own
        self._files = Connection(address(url), known, timeout_s=timeout_s)
        self.operator = operator
        self._tell = progress or silent

    async def __aenter__(self) -> AsyncRig:
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Close its connections."""
        self._files.close()
        await self.connection.close()

    async def status(self) -> StatusAnswer:
        """Return the light: READY or not, and why."""
        return StatusAnswer.model_validate(await self.connection.run(talk.get("/v1/status")))

    async def wait_until_ready(self, limit_s: float = READY_WITHIN_S) -> StatusAnswer:
        """Return the light once it is READY; `NotReadyError` says why it is not."""
        found = await self.connection.run(talk.wait_until_ready(limit_s))
        return StatusAnswer.model_validate(found)

    async def abort(self) -> AbortAnswer:
        """Abort whatever the rig does; the vacuum is on when this returns."""
        return AbortAnswer.model_validate(await self.connection.run(talk.send("POST", "/v1/abort")))

    async def drop(
        self,
        sphere: str,
        surface: str,
        height_m: float,
        *,
        operator: str | None = None,
        key: str | None = None,
    ) -> Shot:
        """Drop a sphere and return its shot, analysed; a cancelled wait aborts the drop.

        Parameters
        ----------
        sphere, surface : str
            Names in the rig's materials.
        height_m : float
            Drop height. [m]
        operator : str, optional
            Who hangs the sphere, if not the rig's operator.
        key : str, optional
            Idempotency key: with the same one nothing falls twice.

        Returns
        -------
        Shot
            With fits, advice and reasons; its record is read by `record`.
        """
        number = await self.begin_drop(sphere, surface, height_m, operator=operator, key=key)
        async with self._aborted_on_error(talk.send("DELETE", f"/v1/drops/{number}")):
            answer = await self.connection.run(talk.shot_of_drop(number, self._tell))
        return Shot.of(answer, self._files)

    async def begin_drop(
        self,
        sphere: str,
        surface: str,
        height_m: float,
        *,
        operator: str | None = None,
        key: str | None = None,
    ) -> int:
        """Ask for a drop and return its number at once; the parameters are those of `drop`."""
        body = asking.drop_body((sphere, surface, height_m), operator or self.operator)
        begun = await self.connection.run(
            talk.send("POST", "/v1/drops", body, key=key or fresh_key())
        )
        return int(begun["number"])

    async def series(
        self,
        sphere: str,
        surface: str,
        height_m: float,
        *,
        repeats: int,
        operator: str | None = None,
        key: str | None = None,
    ) -> AsyncIterator[Shot]:
        """Make drops one by one; one that is cancelled while it waits is aborted.

        Parameters
        ----------
        sphere, surface : str
            Names in the rig's materials.
        height_m : float
            Drop height. [m]
        repeats : int
            Drops.
        operator : str, optional
            Who hangs the sphere, if not the rig's operator.
        key : str, optional
            With a key of your own a program that is run again drops only what is missing.

        Yields
        ------
        Shot
            Analysed.
        """
        begins = key or fresh_key()
        for count in range(1, repeats + 1):
            await self.wait_until_ready()
            own_key = f"{begins} {count}"
            yield await self.drop(sphere, surface, height_m, operator=operator, key=own_key)

    async def calibrate(
        self, plan: Sequence[Json] | None = None, *, slot: str | None = None, key: str | None = None
    ) -> CalibrationAnswer:
        """Run a calibration to its end; a cancelled wait aborts it.

        Parameters
        ----------
        plan : sequence of dict, optional
            ``sphere``, ``surface``, ``drop_height_m`` and ``repeats`` each; else the settings'.
        slot : str, optional
            The same slot never runs twice.
        key : str, optional
            Idempotency key.

        Returns
        -------
        CalibrationAnswer
            Done.
        """
        begun = await self.connection.run(asking.begin_calibration(plan, slot, key or fresh_key()))
        async with self._aborted_on_error(talk.abort_calibration(begun["number"])):
            done = await self.connection.run(talk.calibration_of(begun["number"], self._tell))
        return CalibrationAnswer.model_validate(done)

    async def current_calibration(self) -> CalibrationAnswer:
        """Return the calibration in force."""
        found = await self.connection.run(talk.get("/v1/calibrations/current"))
        return CalibrationAnswer.model_validate(found)

    async def shot(self, number: int) -> Shot:
        """Return a shot with its fits."""
        return Shot.of(await self.connection.run(talk.get(f"/v1/shots/{number}")), self._files)

    async def shots(self, limit: int = 50, **filters: Any) -> AsyncIterator[Shot]:
        """Yield shots, newest first.

        Parameters
        ----------
        limit : int, optional
            At most so many.
        **filters : str, optional
            ``sphere``, ``surface``, ``since``, ``until``, ``search``.

        Yields
        ------
        Shot
            With advice and modulus, without its fits.
        """
        async for answer in self.connection.pages("/v1/shots", limit, summary=True, **filters):
            yield Shot.of(answer, self._files)

    async def record(
        self, shot: Shot, start_s: float | None = None, stop_s: float | None = None
    ) -> xarray.Dataset:
        """Return a shot's record, or a stretch of it [s], read in a thread."""
        return await anyio.to_thread.run_sync(shot.record, start_s, stop_s)

    async def fit(
        self, shots: Sequence[int], model: str = "kv2", *, key: str | None = None
    ) -> FitJobAnswer:
        """Fit shots again, several together, and return the fit once it is done."""
        made = await self.connection.run(asking.fit(shots, model, key or fresh_key(), self._tell))
        return FitJobAnswer.model_validate(made)

    async def diagnose(
        self, shots: Sequence[int], base: str = "kv2", *, budget_s: float | None = None
    ) -> DiagnosisAnswer:
        """Ask what a model lacks and return the verdict; with a budget [s] the best until then."""
        talked = asking.diagnose(shots, base, budget_s, fresh_key(), self._tell)
        return DiagnosisAnswer.model_validate(await self.connection.run(talked))

    async def moduli(self, **filters: Any) -> Json:
        """Return the moduli with their uncertainties, filtered as by `Rig.moduli`."""
        return await self.connection.run(talk.get("/v1/moduli", **filters))

    def events(self, after: int | None = None) -> AsyncIterator[Event]:
        """Return the events after ``after``, also over lost connections and restarts."""
        return self.connection.events(after)

    @asynccontextmanager
    async def _aborted_on_error(self, ending: talk.Talk[Json]) -> AsyncIterator[None]:
        """Abort on the rig what was begun, when the wait for it ends before it does."""
        try:
            yield
        except RigError:
            ending.close()
            raise
        except BaseException:
            with anyio.CancelScope(shield=True), suppress(RigError):
                await self.connection.run(ending)
            raise
        ending.close()
