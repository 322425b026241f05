"""Every error a driver may raise, drawn as one tree.

::

    DriverError
    ├── ConfigurationError          the settings cannot describe a real device
    ├── DeviceNotFoundError         nothing answers at that address
    ├── DeviceLostError             it answered before and does not any more (unplugged)
    ├── DeviceBusyError             somebody else holds it
    ├── DeviceTimeoutError          it is there and did not answer in time
    ├── ProtocolError               it answered something the protocol does not allow
    │   ├── SelfTestError           a written pattern did not read back
    │   └── DisobeyedError          it reads back another state than it was told to take
    ├── FirmwareError               an image is missing, wrong or was not accepted
    ├── RecordError                 a record must not be used
    │   ├── OverrunError            samples were lost
    │   └── TriggerTimeoutError     no impact within the allowed time
    └── AbortedError                somebody asked for an end
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from drivers.digitizer import Record


class DriverError(Exception):
    """A device did not do what it was asked.

    Parameters
    ----------
    what : str
        What happened, with values and units.
    why : str, optional
        The likeliest cause.
    remedy : str, optional
        What the person at the rig should do.

    Attributes
    ----------
    record : Record or None
        What was captured nevertheless: evidence to keep apart, never a shot.
    """

    def __init__(self, what: str, *, why: str = "", remedy: str = "") -> None:
        self.what = what
        self.why = why
        self.remedy = remedy
        self.record: Record | None = None
        super().__init__(" ".join(part for part in (what, why, remedy) if part))


class ConfigurationError(DriverError):
    """The settings cannot describe a real device."""


class DeviceNotFoundError(DriverError):
    """Nothing answers at that address."""


class DeviceLostError(DriverError):
    """The device answered before and does not any more."""


class DeviceBusyError(DriverError):
    """Somebody else holds the device."""


class DeviceTimeoutError(DriverError):
    """The device is there and did not answer in time."""


class ProtocolError(DriverError):
    """The device answered something the protocol does not allow."""


class SelfTestError(ProtocolError):
    """A pattern written to the device did not read back."""


class DisobeyedError(ProtocolError):
    """The device reads back another state than it was told to take."""


class FirmwareError(DriverError):
    """A firmware image is missing, wrong or was not accepted."""


class RecordError(DriverError):
    """A record must not be used.

    ``record`` is what was captured nevertheless: evidence to keep apart, never a shot.
    """

    def __init__(
        self, what: str, *, why: str = "", remedy: str = "", record: Record | None = None
    ) -> None:
        super().__init__(what, why=why, remedy=remedy)
        self.record = record


class OverrunError(RecordError):
    """Samples were lost between the converter and the host."""


class TriggerTimeoutError(RecordError):
    """No impact was seen within the allowed time."""


class AbortedError(DriverError):
    """Somebody asked for an end."""
