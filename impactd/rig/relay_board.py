"""The relay board of the settings, for the daemon and for whoever makes the valve safe without it.

It loads in a moment and reads `[valve]` only: a mistake in another table must not keep the valve
open.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from drivers.relay.lcus import LcusSettings, LcusValve
from drivers.relay.numato import NumatoSettings, NumatoValve
from drivers.valve import Valve
from impactd.settings.errors import explain
from impactd.settings.instrument import ValveSection
from impactd.settings.settings import SettingsError, read_toml


class _ValveOnly(BaseModel):
    """What a settings file says about the relay board, whatever else it says."""

    model_config = ConfigDict(extra="ignore")

    valve: ValveSection
    simulation: Any = None


def load_valve_section(path: Path | None = None) -> ValveSection | None:
    """Return the relay board of a settings file, the only part of it that is checked.

    It has a port; None on the simulated rig, whose board ends with its daemon. ``path`` is as in
    `impactd.settings.settings.load_settings`. Raises SettingsError if the file cannot be read, or
    the board's table is wrong.
    """
    file, content = read_toml(path)
    try:
        found = _ValveOnly.model_validate(content)
    except ValidationError as error:
        findings = tuple(explain(detail, _ValveOnly) for detail in error.errors())
        raise SettingsError(file, findings[0].path_in_file, findings[0].reason, findings) from None
    if found.simulation is not None:
        return None
    if not found.valve.port:
        raise SettingsError(file, "valve.port", "missing: name the relay's serial port")
    return found.valve


def build_valve(section: ValveSection, port: str) -> Valve:
    """Return the driver of the relay board, unopened; the port may be a pseudo-terminal."""
    if section.driver == "lcus":
        return LcusValve(LcusSettings(port=port, timeout_s=section.timeout_s))
    return NumatoValve(
        NumatoSettings(
            port=port,
            relay=section.relay,
            adc_channel=section.adc_channel,
            adc_volts_per_code=section.adc_volts_per_code,
            held_threshold_v=section.held_threshold_v,
            held_above=section.held_above is not False,
            timeout_s=section.timeout_s,
        )
    )
