"""Checks of the rig while nothing runs, so that READY is true."""

from __future__ import annotations

import time
from dataclasses import replace

from drivers.errors import RecordError
from impactd.acquisition.devices import Findings, look
from impactd.acquisition.preflight import Check
from impactd.rig.rig import Rig
from impactd.settings.settings import Settings

_INPUT_EVERY_LOOKS = 10
_LONG_AGO_S = -1e9


class IdleWatch:
    """Times of the last and the next check of a connected rig; used by the loop's thread only.

    ``findings`` is replaced as a whole, so other threads may read it.
    """

    def __init__(self, rig: Rig, settings: Settings) -> None:
        self.findings = Findings()
        self._rig = rig
        self._settings = settings
        self._looked_s = _LONG_AGO_S
        self._looks = 0
        self._restless_since_s: float | None = None

    def is_due(self) -> bool:
        """Return whether it is time for another check."""
        pause_s = time.monotonic() - self._looked_s
        return pause_s >= self._settings.timeouts.idle_check_every_s

    def look_again(self) -> None:
        """Check everything now, because a person may have repaired something."""
        self._looked_s = _LONG_AGO_S
        self._looks = 0

    def look(self) -> None:
        """Check valve and gauge, now and then the input too; raise DriverError if one is silent."""
        restless = self._restless_since_s is not None
        at_input = self._looks % _INPUT_EVERY_LOOKS == 0 or restless
        try:
            found = look(self._rig, self._settings, at_input=at_input)
        except RecordError as error:
            # Lost samples are no lost device: the input refuses until a look succeeds.
            check = Check("input", False, error.what.rstrip("."), error.remedy)
            found = Findings((*_without_input(self.findings), check), None)
        if not at_input:
            kept = tuple(check for check in self.findings.checks if check.name == "input")
            found = Findings((*found.checks, *kept), self.findings.baseline)
        self.findings = self._with_patience(found)
        self._looked_s = time.monotonic()
        self._looks += 1

    def _with_patience(self, found: Findings) -> Findings:
        """Accept a restless input for a while: the last sphere is still bouncing.

        A drop that comes now waits just as long in its own pre-flight.
        """
        check = next((check for check in found.checks if check.name == "input"), None)
        if check is None or check.ok:
            self._restless_since_s = None
            return found
        if self._restless_since_s is None:
            self._restless_since_s = time.monotonic()
        if time.monotonic() - self._restless_since_s > self._settings.timeouts.settle_s:
            return found
        calm = replace(check, ok=True, sentence=f"{check.sentence}; waiting for it to settle")
        return Findings((*_without_input(found), calm), found.baseline)


def _without_input(findings: Findings) -> tuple[Check, ...]:
    return tuple(check for check in findings.checks if check.name != "input")
