"""Opens the rig's devices, reads them while nothing runs, and makes them safe."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import dataclass, field

from drivers.errors import AbortedError, DriverError
from drivers.valve import ValveReport
from impactd.acquisition.failures import Doubt, Failure, failure_of
from impactd.acquisition.preflight import Baseline, Check, check_input
from impactd.rig.rig import Rig
from impactd.settings.settings import Settings

# An abort's promise of 100 ms is mostly the valve's.
_STOP_PATIENCE_S = 0.03
_LOOK_SAMPLES = 20_000


@dataclass
class Findings:
    """The results of the last check of the devices.

    They are replaced as a whole, so reading needs no lock.
    """

    checks: tuple[Check, ...] = field(default=())
    """Digitizer, valve, sphere, input."""
    baseline: Baseline | None = None
    """Of the idle input."""

    @property
    def refusal(self) -> Check | None:
        """The first check that forbids a drop."""
        return next((check for check in self.checks if not check.ok), None)


def connect(rig: Rig) -> None:
    """Open both devices; a device that fails is closed, so that the next try starts clean.

    Both may be open, lost or never opened. Raises DriverError, for the valve first: it is the part
    that can drop something.
    """
    troubles: list[DriverError] = []
    for device, prove in ((rig.valve, lambda: hold(rig)), (rig.digitizer, lambda: None)):
        try:
            device.ensure_ready()
            # An open port proves nothing: what was not confirmed before a fault is asked again.
            prove()
        except DriverError as error:
            troubles.append(error)
            with suppress(DriverError):
                device.close()
    if troubles:
        raise troubles[0]


def look(rig: Rig, settings: Settings, *, at_input: bool) -> Findings:
    """Check a connected rig on which nothing runs; a failed check does not raise.

    ``at_input`` samples the input too, which takes some ten milliseconds. Raises DriverError if a
    device does not answer.
    """
    reading = rig.valve.vacuum()
    sphere = (
        "cannot tell whether a sphere is held: the valve has no vacuum gauge"
        if reading is None
        else f"{'a sphere is held' if reading.held else 'no sphere is held'}, gauge "
        f"{reading.volts:.2f} V"
    )
    who = rig.digitizer.identity
    note = f" ({who.note})" if who.note else ""
    confirms = "reads back" if rig.valve.can_confirm else "commanded, unconfirmed"
    checks = [
        Check("digitizer", True, f"{who.model} {who.serial_number}{note}"),
        Check("valve", True, f"{rig.valve.identity}, {confirms}, vacuum on"),
        Check("sphere", True, sphere),
    ]
    baseline = None
    if at_input:
        preflight = settings.preflight
        # A short look, because a request may come in meanwhile; pre-flight looks longer.
        samples = min(preflight.baseline_samples, _LOOK_SAMPLES)
        baseline = Baseline.of(rig.digitizer.sample_baseline(samples))
        checks.append(check_input(baseline, preflight, settings.trigger))
    return Findings(tuple(checks), baseline)


def make_safe(rig: Rig) -> list[Exception]:
    """Put the vacuum on and stop the digitizer, from any thread, whatever state they are in.

    The valve is waited for. The digitizer is told to stop and waited for only briefly: whoever
    drives it drains it. Return all errors; both devices were tried, also when they are gone.
    """
    troubles: list[Exception] = []
    stopping = threading.Thread(
        target=_stop_digitizer, args=(rig, troubles), name="stop-digitizer", daemon=True
    )
    try:
        stopping.start()
    except RuntimeError as error:  # no thread left: the valve must not depend on one
        troubles.append(error)
    try:
        rig.valve.ensure_safe()
    except Exception as error:
        troubles.insert(0, error)
    if stopping.ident is not None:
        stopping.join(_STOP_PATIENCE_S)
    return troubles


def _stop_digitizer(rig: Rig, troubles: list[Exception]) -> None:
    try:
        rig.digitizer.ensure_stopped()
    except Exception as error:
        troubles.append(error)


def hold(rig: Rig) -> ValveReport:
    """Put the vacuum on, once more behind an abort that cut in, and return the last report.

    Raises DriverError if the valve does not follow.
    """
    try:
        return rig.valve.hold()
    except AbortedError:
        rig.valve.ensure_safe()  # waits for the abort, which would cut the next command, too
        return rig.valve.hold()


def confirm_safe(rig: Rig) -> Failure | None:
    """Make safe and require confirmation, after a drop that ended early.

    Return what forbids the next drop, ``None`` when nothing does. The devices may be gone.
    """
    report: ValveReport | None = None
    troubles: list[Exception] = []
    try:
        rig.valve.ensure_safe()
        report = hold(rig)
    except Exception as error:  # whatever it is, somebody must hear of it and the drop must end
        troubles.append(error)
    _stop_digitizer(rig, troubles)
    if troubles:
        found = failure_of(troubles[0])
        doubt = found.doubt if found.doubt is not Doubt.NONE else Doubt.RETRY
        return Failure(found.problem, doubt)
    if report is not None and rig.valve.can_confirm and not report.confirmed:
        return failure_of(
            DriverError(
                "The relay board did not read back that the vacuum is on.",
                remedy="Remove the sphere, then check relay and valve.",
            )
        )
    return None
