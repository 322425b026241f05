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
    """The metadata of a shot.

    Attributes
    ----------
    started_utc : str
        When the acquisition of this record was started (`moment.utc_now`).
    started_monotonic_ns : int
        Host clock at that same moment; ties the other host times to UTC. [ns]
    gravity_m_per_s2 : float
        [m/s^2]
    sphere, surface : Sphere, Surface or None
        What was known of them on that day, with their names. ``None`` = unknown.
    drop_height_m : float or None
        [m]
    speed_repeatability : float or None
        Relative standard deviation of the impact speed. [1]
    valve_monotonic_ns : int or None
        Host clock when the command that opened the valve had been handed over. [ns]
    valve_identity : str
        The board's own words.
    valve_confirmed : bool or None
        Whether the board read the command back.
    vacuum_v : float or None
        The gauge before the release. [V]
    trigger : TriggerSettings or None
        What it waited for.
    baseline_v, noise_rms_v : float or None
        Of the idle input at pre-flight. [V]
    sensor : Sensor or None
        What was known of the load cell.
    calibration : int or None
        The calibration in force, by number.
    restitution : Quantity or None
        As somebody else measured it (imports). [1]
    environment : Environment or None
        At the shot: as the technician read it, or a sensor.
    source : str
        ``drop`` or ``import``.
    origin : str
        For an import, the file it came from.
    configuration : dict
        Snapshot of the settings, JSON, no secrets.
    notes : tuple of str
        What a reader should know, e.g. ``"valve state unconfirmed"``.
    """

    started_utc: str
    started_monotonic_ns: int
    gravity_m_per_s2: float
    operator: str = ""
    sphere: Sphere | None = None
    surface: Surface | None = None
    drop_height_m: float | None = None
    speed_repeatability: float | None = None
    valve_monotonic_ns: int | None = None
    valve_identity: str = ""
    valve_confirmed: bool | None = None
    vacuum_v: float | None = None
    digitizer: DigitizerIdentity | None = None
    trigger: TriggerSettings | None = None
    baseline_v: float | None = None
    noise_rms_v: float | None = None
    sensor: Sensor | None = None
    calibration: int | None = None
    restitution: Quantity | None = None
    environment: Environment | None = None
    source: str = "drop"
    origin: str = ""
    configuration: dict[str, Any] = field(default_factory=dict)
    software: str = ""
    notes: tuple[str, ...] = ()

    @property
    def impact_speed_m_per_s(self) -> float | None:
        """Speed of a free fall from the drop height, sqrt(2 g h); ``None`` without one. [m/s]"""
        if self.drop_height_m is None:
            return None
        return float(np.sqrt(2.0 * self.gravity_m_per_s2 * self.drop_height_m))


@dataclass(frozen=True)
class Recording:
    """A record as the archive keeps it.

    Attributes
    ----------
    samples : ndarray, shape (n,)
        Raw converter codes (int16), never corrected; an import keeps the type it came in.
    per_code, offset : float
        ``signal = samples * per_code + offset``. [unit of ``quantity``]
    quantity : str
        One of ``QUANTITIES``.
    sample_rate_hz, sample_rate_u_hz : float
        Calibrated rate and its standard uncertainty (0 = not stated). [Hz]
    trigger_index : int
        [1]
    range_v : float or None
        The converter's range, +/-. [V]
    calibrated : bool or None
        Whether the converter's own calibration is in the two numbers; ``None`` = unknown.
    clipped : bool
        The record sits on a limit.
    first_sample_index, samples_streamed : int
        Place in the stream. [1]
    trigger_monotonic_ns : int or None
        Host clock when the trigger was recognised. [ns]
    status_words : tuple of int
        Acquisition status at start and end.
    """

    samples: NDArray[Any]
    per_code: float
    offset: float
    quantity: str
    sample_rate_hz: float
    sample_rate_u_hz: float
    trigger_index: int
    range_v: float | None = None
    calibrated: bool | None = None
    clipped: bool = False
    first_sample_index: int = 0
    samples_streamed: int = 0
    trigger_monotonic_ns: int | None = None
    status_words: tuple[int, ...] = ()

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
    """A shot as read back from its file.

    Attributes
    ----------
    shot : Shot
        Its row in the index.
    metadata : ShotMetadata
        What is known of the shot beside its samples.
    drop : Drop or None
        The drop it belongs to, as it was when the file was written; ``None`` for an import.
    """

    shot: Shot
    recording: Recording
    metadata: ShotMetadata
    drop: Drop | None

    @property
    def record(self) -> Record:
        """The record as a digitizer gave it, for replay.

        Raises
        ------
        ArchiveError
            If the shot was recorded by another instrument.
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
