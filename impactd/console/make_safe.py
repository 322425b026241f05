"""``impactd make-safe``: the vacuum on, when the daemon that opened the valve is gone.

It opens the relay board of the settings and nothing else: no digitizer, no archive, no lock but
the port's own.
"""

from __future__ import annotations

import json
import time
from pathlib import Path

from drivers.errors import DriverError
from drivers.valve import Valve, ValveReport
from impactd.console.failure import Failure
from impactd.rig.relay_board import build_valve, load_valve_section

_PAUSE_S = 0.1


def run(config: Path | None, wait_s: float, *, as_json: bool = False) -> None:
    """Switch the vacuum on, and say how sure that is.

    Parameters
    ----------
    config : Path or None
        As given on the command line.
    wait_s : float
        How long a board that is busy, gone or silent is asked again. [s]
    as_json : bool
        ``{"vacuum_on": true, "confirmed": true}`` in place of words; null for a simulated rig.

    Raises
    ------
    Failure
        If the valve could not be made safe; somebody must look at it.
    SettingsError
        If the settings do not tell where the board is.
    """
    section = load_valve_section(config)
    if section is None:
        words = "The simulated rig's valve ends with its daemon: there is nothing to make safe."
        print(json.dumps({"vacuum_on": None, "confirmed": None}) if as_json else words)
        return
    assert section.port is not None, "load_valve_section asks for it"
    # Built again for each attempt: a board that failed half-way is greeted from the start.
    ends_s = time.monotonic() + wait_s
    while True:
        try:
            report = _hold(build_valve(section, section.port))
            break
        except DriverError as error:
            if time.monotonic() > ends_s:
                raise Failure(
                    f"the valve could NOT be made safe: {error} Remove the sphere by hand."
                ) from error
        time.sleep(_PAUSE_S)
    if as_json:
        print(json.dumps({"vacuum_on": report.vacuum_on, "confirmed": report.confirmed}))
        return
    sure = "confirmed" if report.confirmed else "commanded; this board cannot confirm it"
    print(f"The vacuum is on ({sure}).")


def _hold(valve: Valve) -> ValveReport:
    """Open the port, switch the vacuum on, give the port back."""
    try:
        valve.ensure_ready()
        return valve.hold()
    finally:
        valve.close()
