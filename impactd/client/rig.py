"""A rig, for scripts and notebooks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import TYPE_CHECKING, Any

from impactd.aliases import Json
from impactd.client import asking, talk
from impactd.client.connection import Connection
from impactd.client.environment import address, token_from_environment
from impactd.client.events import Event
from impactd.client.progress import ProgressBar
from impactd.client.runs import READY_WITHIN_S, Calibration, Series
from impactd.client.shot import Shot
from impactd.client.talk import Tell, fresh_key
from impactd.wire.answers import FitJobAnswer
from impactd.wire.rig_answers import (
    AbortAnswer,
    CalibrationAnswer,
    DiagnosisAnswer,
    StatusAnswer,
)

if TYPE_CHECKING:
    import pandas


class Rig:
    """A rig and its daemon.

    Parameters
    ----------
    url : str, optional
        The daemon's address; without it IMPACTD_URL, or where it listens by default.
    token : str, optional
        A bearer token; without it IMPACTD_TOKEN, or the file that IMPACTD_TOKEN_FILE names.
    operator : str, optional
        Who hangs the spheres; your login name.
    progress : callable, optional
        Is told how far a wait is: a text, and a share or ``None``. Without it a bar on a terminal
        or in Jupyter.
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
        self.connection = Connection(
            address(url), token or token_from_environment(), timeout_s=timeout_s
        )
        self.operator = operator
        self._progress = progress

    def __enter__(self) -> Rig:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Close the connection."""
        self.connection.close()

    def status(self) -> StatusAnswer:
        """Return the light: READY or not, and why."""
        return StatusAnswer.model_validate(self.connection.get("/v1/status"))

    def wait_until_ready(self, limit_s: float = READY_WITHIN_S) -> StatusAnswer:
        """Return the light once it is READY; `NotReadyError` says why it is not."""
        return StatusAnswer.model_validate(self.connection.run(talk.wait_until_ready(limit_s)))

    def abort(self) -> AbortAnswer:
        """Abort whatever the rig does; the vacuum is on when this returns."""
        return AbortAnswer.model_validate(self.connection.send("POST", "/v1/abort"))

    def drop(
        self,
        sphere: str,
        surface: str,
        height_m: float,
        *,
        operator: str | None = None,
        temperature_C: asking.Reading | None = None,
        relative_humidity: asking.Reading | None = None,
        key: str | None = None,
    ) -> Shot:
        """Drop a sphere and return its shot, analysed.

        Parameters
        ----------
        sphere, surface : str
            Names in the rig's materials.
        height_m : float
            Lowest point of the sphere above the surface, for example ``45 * mm``. [m]
        operator : str, optional
            Who hangs the sphere, if not the rig's operator.
        temperature_C : tuple of float, optional
            Of spheres and coupons, with its standard uncertainty. [degC, K]
        relative_humidity : tuple of float, optional
            Of the air, with its standard uncertainty. [1]
        key : str, optional
            Idempotency key: with the same one nothing falls twice.

        Returns
        -------
        Shot
            With fits, advice and reasons.

        Raises
        ------
        NotReadyError
            If the rig cannot drop now.
        EndedError
            If the drop ended without a shot.
        """
        body = asking.drop_body(
            (sphere, surface, height_m),
            operator or self.operator,
            temperature_C=temperature_C,
            relative_humidity=relative_humidity,
        )
        with self.telling() as tell:
            answer = self.connection.run(asking.drop(body, key or fresh_key(), tell))
        return Shot.of(answer, self.connection)

    def series(
        self,
        sphere: str,
        surface: str,
        height_m: float,
        *,
        repeats: int,
        operator: str | None = None,
        key: str | None = None,
    ) -> Series:
        """Return a series of drops: ``with rig.series(...) as series: for shot in series: ...``.

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
            With a key of your own a script that is run again drops only what is missing.

        Returns
        -------
        Series
            Nothing falls before it is asked for a drop.
        """
        body = asking.drop_body((sphere, surface, height_m), operator or self.operator)
        return Series(self.connection, self.telling, body, repeats=repeats, key=key or fresh_key())

    def calibration(
        self, plan: Sequence[Json] | None = None, *, slot: str | None = None, key: str | None = None
    ) -> Calibration:
        """Begin a calibration: ``with rig.calibration() as run: ...`` waits for its end.

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
        Calibration
            It has begun.
        """
        begun = self.connection.run(asking.begin_calibration(plan, slot, key or fresh_key()))
        return Calibration(self.connection, self.telling, begun)

    def current_calibration(self) -> CalibrationAnswer:
        """Return the calibration in force."""
        return CalibrationAnswer.model_validate(self.connection.get("/v1/calibrations/current"))

    def shot(self, number: int) -> Shot:
        """Return a shot with its fits."""
        return Shot.of(self.connection.get(f"/v1/shots/{number}"), self.connection)

    def shots(self, limit: int = 50, **filters: Any) -> Iterator[Shot]:
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
        for answer in self.connection.pages("/v1/shots", limit, summary=True, **filters):
            yield Shot.of(answer, self.connection)

    def shots_frame(self, limit: int = 50, **filters: Any) -> pandas.DataFrame:
        """Return shots as a table; the parameters are those of `shots`."""
        from impactd.client.tables import shots_frame  # noqa: PLC0415 - needs an extra

        return shots_frame(self.shots(limit, **filters))

    def fit(
        self, shots: Sequence[int], model: str = "kv2", *, key: str | None = None
    ) -> FitJobAnswer:
        """Fit shots again, several together, and return the fit once it is done."""
        with self.telling() as tell:
            made = self.connection.run(asking.fit(shots, model, key or fresh_key(), tell))
        return FitJobAnswer.model_validate(made)

    def diagnose(
        self,
        shots: Sequence[int],
        base: str = "kv2",
        *,
        budget_s: float | None = None,
        key: str | None = None,
    ) -> DiagnosisAnswer:
        """Ask what a model lacks and return the verdict; with a budget [s] the best until then."""
        with self.telling() as tell:
            talked = asking.diagnose(shots, base, budget_s, key or fresh_key(), tell)
            return DiagnosisAnswer.model_validate(self.connection.run(talked))

    def moduli(self, **filters: Any) -> Json:
        """Return the moduli with their uncertainties.

        Parameters
        ----------
        **filters : str, optional
            ``specimen``, ``since``, ``until``, ``model``.

        Returns
        -------
        dict
            ``impactd-moduli/1``.
        """
        return self.connection.get("/v1/moduli", **filters)

    def moduli_frame(self, **filters: Any) -> pandas.DataFrame:
        """Return the moduli as a table, a material a row; the parameters are those of `moduli`."""
        from impactd.client.tables import moduli_frame  # noqa: PLC0415 - needs an extra

        return moduli_frame(self.moduli(**filters))

    def events(self, after: int | None = None) -> Iterator[Event]:
        """Yield events as they come, over lost lines and restarts.

        Parameters
        ----------
        after : int, optional
            Number of the last event that was seen; 0 begins with the first one there is.

        Yields
        ------
        Event
            None twice, none left out.
        """
        return self.connection.events(after)

    @contextmanager
    def telling(self, before: str = "") -> Iterator[Tell]:
        """Give what is to be told how far a wait is; the bar goes away at the end."""
        bar = ProgressBar()
        tell = self._progress or bar.show
        try:
            yield lambda text, share: tell(before + text, share)
        finally:
            bar.close()
