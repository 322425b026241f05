"""The digitizer board of the settings: its driver on the real bus, or on a simulated one."""

from __future__ import annotations

from typing import Any

from drivers.daq3500.device import Daq3500
from drivers.daq3500.settings import Daq3500Settings
from drivers.digitizer import Digitizer
from drivers.usb2637.device import Usb2637
from drivers.usb2637.settings import Usb2637Settings
from impactd.settings.instrument import Daq3500Section, DigitizerSection

_SETTLING_CODES = {1: 0, 5: 1, 10: 2, 1000: 3}


def build_digitizer(
    section: DigitizerSection, *, backend: Any = None, pace_checked: bool = True
) -> Digitizer:
    """Return the driver of the board, unopened.

    ``backend`` is None for libusb. Raises ConfigurationError if the settings cannot describe a real
    board.
    """
    keys = section.model_dump(exclude={"driver", "settling_us"}) | {"pace_checked": pace_checked}
    if isinstance(section, Daq3500Section):
        settling_code = _SETTLING_CODES[section.settling_us]
        settings = Daq3500Settings(**keys, settling_code=settling_code)
        return Daq3500(settings, backend=backend)
    return Usb2637(Usb2637Settings(**keys), backend=backend)
