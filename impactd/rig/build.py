"""From settings to a rig whose devices are still closed: the real one, or the simulated one."""

from __future__ import annotations

from drivers.errors import ConfigurationError
from impactd.rig.digitizer_board import build_digitizer
from impactd.rig.relay_board import build_valve
from impactd.rig.rig import PersonLoader, Rig
from impactd.settings.materials import Materials
from impactd.settings.settings import Settings


def build_rig(settings: Settings, materials: Materials) -> Rig:
    """Return the rig that the settings describe, unopened: with ``simulation``, the simulated one.

    The materials are those that the simulated technician may be asked to hang. Raises
    ConfigurationError if the settings cannot describe real devices.
    """
    if settings.simulated:
        # Imported here, so that a real rig's daemon never loads the simulator.
        from impactd.rig.simulated import build_simulated_rig  # noqa: PLC0415

        return build_simulated_rig(settings, materials)
    if settings.valve.port is None:
        raise ConfigurationError("valve.port is missing.", remedy="Name the relay's serial port.")
    return Rig(
        digitizer=build_digitizer(settings.digitizer),
        valve=build_valve(settings.valve, settings.valve.port),
        loader=PersonLoader(),
        name=settings.rig.name,
        simulated=False,
    )
