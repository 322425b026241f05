"""Everything a shot file says beside the record itself, as values.

``Recording`` is the record as the archive keeps it (a digitizer's ``Record`` or an import),
``ShotMetadata`` what is known beside it, ``StoredShot`` both as read back.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Environment, Quantity, Sensor, Sphere, Surface
from drivers.digitizer import DigitizerIdentity, Record, TriggerSettings
from impactd.storage.drops import Drop
from impactd.storage.errors import ArchiveError
from impactd.storage.shots import Shot

VOLTAGE = "voltage"
QUANTITIES = {VOLTAGE: "V", "force_N": "N", "acceleration_m_per_s2": "m/s^2"}
"""What a recording may be of, with its unit."""


@dataclass(frozen=True)
class ShotMetadata:
    """The metadata of a shot; ``None`` is unknown."""

    started_utc: str
    """When the acquisition of this record was started (`timestamp.utc_now`)."""
    started_monotonic_ns: int
    """Host clock at that same moment; ties the other host times to UTC. [ns]"""
    gravity_m_per_s2: float
    operator: str = ""
    sphere: Sphere | None = None
    """As it was known on that day, with its name; ``surface`` too."""
    surface: Surface | None = None
    drop_height_m: float | None = None
    speed_repeatability: float | None = None
    """Relative standard deviation of the impact speed. [1]"""
    valve_monotonic_ns: int | None = None
    """Host clock when the command that opened the valve had been handed over. [ns]"""
    valve_identity: str = ""
    """The board's own words."""
    valve_confirmed: bool | None = None
    """Whether the board read the command back."""
    vacuum_v: float | None = None
    """The gauge before the release. [V]"""
    digitizer: DigitizerIdentity | None = None
    trigger: TriggerSettings | None = None
    baseline_v: float | None = None
    """Of the idle input at pre-flight, as ``noise_rms_v``. [V]"""
    noise_rms_v: float | None = None
    sensor: Sensor | None = None
    calibration: int | None = None
    """The calibration in force, by number."""
    restitution: Quantity | None = None
    """As somebody else measured it (imports). [1]"""
    environment: Environment | None = None
    """At the shot: as the technician read it, or a sensor."""
    source: str = "drop"
    """``drop`` or ``import``."""
    origin: str = ""
    """For an import, the file it came from."""
    configuration: dict[str, Any] = field(default_factory=dict)
    """Snapshot of the settings, JSON, no secrets."""
    software: str = ""
    notes: tuple[str, ...] = ()
    """What a reader should know, e.g. ``"valve state unconfirmed"``."""

    @property
    def impact_speed_m_per_s(self) -> float | None:
        """Speed of a free fall from the drop height, sqrt(2 g h); ``None`` without one. [m/s]"""
        if self.drop_height_m is None:
            return None
        return float(np.sqrt(2.0 * self.gravity_m_per_s2 * self.drop_height_m))


@dataclass(frozen=True)
class Recording:
    """A record as the archive keeps it."""

    samples: NDArray[Any]
    """Shape (n,). Raw converter codes (int16), never corrected; an import keeps the type it came
    in."""
    per_code: float
    offset: float
    """``signal = samples * per_code + offset``. [unit of ``quantity``]"""
    quantity: str
    """One of ``QUANTITIES``."""
    sample_rate_hz: float
    """Calibrated rate. [Hz]"""
    sample_rate_u_hz: float
    """Its standard uncertainty; 0 = not stated. [Hz]"""
    trigger_index: int
    range_v: float | None = None
    """The converter's range, +/-. [V]"""
    calibrated: bool | None = None
    """Whether the converter's own calibration is in ``per_code`` and ``offset``; ``None`` =
    unknown."""
    clipped: bool = False
    """Whether the record reaches a limit of the converter or the amplifier."""
    first_sample_index: int = 0
    """Place in the stream, which had ``samples_streamed``. [1]"""
    samples_streamed: int = 0
    trigger_monotonic_ns: int | None = None
    """Host clock when the trigger was recognised. [ns]"""
    status_words: tuple[int, ...] = ()
    """Acquisition status at start and end."""

    @property
    def signal(self) -> NDArray[np.float64]:
        """The record in its unit, shape (n,). [V, N or m/s^2]"""
        return self.samples.astype(np.float64) * self.per_code + self.offset

    @property
    def unit(self) -> str:
        """Unit of the signal."""
        return QUANTITIES[self.quantity]

    @property
    def quantum(self) -> float | None:
        """Step of the converter in the unit of the signal, ``None`` where it is not known."""
        return self.per_code if self.samples.dtype.kind in "iu" else None


@dataclass(frozen=True)
class StoredShot:
    """A shot as read back from its file."""

    shot: Shot
    """Its row in the index."""
    recording: Recording
    metadata: ShotMetadata
    drop: Drop | None
    """As it was when the file was written; ``None`` for an import."""

    @property
    def record(self) -> Record:
        """The record as a digitizer gave it, for replay.

        Raises ArchiveError if the shot was recorded by another instrument.
        """
        kept = self.recording
        if kept.samples.dtype != np.int16 or kept.quantity != VOLTAGE or kept.range_v is None:
            raise ArchiveError(f"Shot {self.shot.number} is no record of this digitizer.")
        return Record(
            codes=kept.samples,
            volts_per_code=kept.per_code,
            offset_v=kept.offset,
            calibrated=bool(kept.calibrated),
            sample_rate_hz=kept.sample_rate_hz,
            sample_rate_u_hz=kept.sample_rate_u_hz,
            range_v=kept.range_v,
            trigger_index=kept.trigger_index,
            first_sample_index=kept.first_sample_index,
            trigger_monotonic_ns=kept.trigger_monotonic_ns or 0,
            status_words=kept.status_words,
            samples_streamed=kept.samples_streamed,
        )
