"""The sections of the one settings file: every key with its unit, its meaning and its limits.

A key that must be measured, read off a certificate or looked up on the rig has no default, and
its ``json_schema_extra["where"]`` says where its value comes from; the message for a missing key
quotes it. Keys that are choices have defaults. `impactd.settings` puts the sections together.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from analysis.campaign import Quantity, Sensor

_CERTIFICATE = "take it from the load cell's certificate or from a calibration"
_ENUMERATION = "read it with `lsusb` while the board is plugged in"


def _key(meaning: str, unit: str = "", *, where: str = "", **limits: Any) -> Any:
    """Describe one key; without ``default`` among the limits it is required."""
    extra: dict[str, Any] = {}
    if unit:
        extra["unit"] = unit
    if where:
        extra["where"] = where
    text = f"{meaning} [{unit}]" if unit else meaning
    return Field(description=text, json_schema_extra=extra or None, allow_inf_nan=False, **limits)


def _choice(meaning: str, unit: str = "", **limits: Any) -> Any:
    """Describe a key that is not a number (pydantic refuses number limits there)."""
    return Field(
        description=f"{meaning} [{unit}]" if unit else meaning,
        json_schema_extra={"unit": unit} if unit else None,
        **limits,
    )


class Section(BaseModel):
    """A table of the settings file; unknown keys are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False)


class MeasuredValue(Section):
    """A value with its standard uncertainty, in the unit of the key it stands under."""

    value: float = _key("Best estimate, in the unit of the key")
    u: float = _key("Standard uncertainty (k = 1), in the unit of the key", gt=0)

    def quantity(self) -> Quantity:
        """Return the same as an analysis value."""
        return Quantity(self.value, self.u)


class RigSection(Section):
    """What the rig is and what may be asked of it."""

    name: str = _choice("Name of the rig, written into every shot", min_length=1, max_length=80)
    unattended_safe: bool = _choice(
        "Whether somebody answered for dropping spheres with nobody present", default=False
    )
    min_drop_height_m: float = _key("Smallest height the stand allows", "m", gt=0, default=0.002)
    max_drop_height_m: float = _key(
        "Greatest height the stand allows", "m", gt=0, le=5.0, where="measure it on the stand"
    )

    @model_validator(mode="after")
    def _ordered(self) -> RigSection:
        if self.min_drop_height_m >= self.max_drop_height_m:
            raise ValueError("min_drop_height_m must be smaller than max_drop_height_m")
        return self


class ServerSection(Section):
    """Where the REST service listens."""

    host: str = _choice(
        "Address to listen on; anything but loopback needs a proxy with TLS", default="127.0.0.1"
    )
    port: int = _choice("TCP port; 0 takes a free one", ge=0, le=65535, default=8642)
    allowed_hosts: tuple[str, ...] = _choice(
        "Host names a request may carry", default=("127.0.0.1", "localhost", "[::1]")
    )


class StorageSection(Section):
    """Where shots are kept."""

    directory: Path = _choice("Folder of the archive; relative to the working directory")
    reserve_bytes: int = _key(
        "Free space below which no drop is started", "byte", ge=0, default=1_000_000_000
    )


class DigitizerSection(Section):
    """The digitizer: identity on the bus, input, and its calibrated rate."""

    vendor_id: int = _key("USB vendor id", where=_ENUMERATION, ge=1, le=0xFFFF)
    product_id_unloaded: int = _key(
        "USB product id before the firmware is loaded", where=_ENUMERATION, ge=1, le=0xFFFF
    )
    product_id_loaded: int = _key(
        "USB product id once the firmware runs", where=_ENUMERATION, ge=1, le=0xFFFF
    )
    serial_number: str | None = _choice(
        "Serial number, where two boards are plugged in", default=None
    )
    firmware_file: Path | None = _choice(
        "Intel-hex image for the FX2, supplied by you; relative to this file", default=None
    )
    fpga_file: Path | None = _choice(
        "Bit stream for the FPGA, supplied by you; relative to this file", default=None
    )
    channel: int = _key(
        "Analogue input the conditioner is wired to",
        ge=0,
        le=127,
        where="look where the cable goes",
    )
    differential: bool = _choice(
        "Whether that input is wired differentially",
    )
    range_v: float = _key(
        "Input range, +/-; one of 10, 5, 2, 1, 0.5, 0.2, 0.1",
        "V",
        where="the smallest that holds the largest impact",
    )
    settling_us: Literal[1, 5, 10, 1000] = _choice(
        "Settling time code of the scan entry", "us", default=1
    )
    pacer_divisor: int = _key(
        "N of f = 48 MHz / (N + 1); 47 is 1 MHz", ge=1, le=2**31 - 1, default=47
    )
    sample_rate_hz: float = _key(
        "Calibrated sample rate, not the nominal one",
        "Hz",
        gt=0,
        where="measure it against a frequency standard",
    )
    sample_rate_u_hz: float = _key(
        "Standard uncertainty of that rate",
        "Hz",
        gt=0,
        where="it comes with the rate's calibration",
    )
    ring_seconds: float = _key("Length of the ring buffer", "s", gt=0, le=60, default=4.0)
    transfer_bytes: int = _key(
        "Size of one bulk read, a multiple of 512", "byte", ge=512, multiple_of=512, default=16384
    )

    wire_log_file: Path | None = _choice(
        "Where to write every USB transfer, for the first run with a new board", default=None
    )

    @field_validator("range_v")
    @classmethod
    def _known_range(cls, value: float) -> float:
        if value not in (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1):
            raise ValueError("the board has the ranges 10, 5, 2, 1, 0.5, 0.2 and 0.1 V only")
        return value

    @model_validator(mode="after")
    def _plausible_rate(self) -> DigitizerSection:
        nominal_hz = 48e6 / (self.pacer_divisor + 1)
        # The family's measured clocks are off by up to 1 %; 5 % is a slip of the pen.
        if abs(self.sample_rate_hz / nominal_hz - 1) > 0.05:
            raise ValueError(
                f"sample_rate_hz = {self.sample_rate_hz:g} Hz is more than 5 % away from the "
                f"{nominal_hz:g} Hz that pacer_divisor = {self.pacer_divisor} asks for"
            )
        return self


class TriggerSection(Section):
    """When a record begins and how long it is."""

    level_v: float = _key(
        "Level above the baseline that starts a record; its sign is the slope",
        "V",
        where="well above the noise, well below the softest impact",
    )
    hysteresis_v: float = _key(
        "The signal must have been this far below the level",
        "V",
        gt=0,
        where="several times the noise",
    )
    pre_trigger_s: float = _key("Kept before the trigger", "s", ge=0.001, le=1.0, default=0.020)
    record_s: float = _key(
        "Length of the whole record; must reach past the first bounce",
        "s",
        gt=0.001,
        le=10.0,
        default=0.4,
    )

    @model_validator(mode="after")
    def _consistent(self) -> TriggerSection:
        if self.level_v == 0:
            raise ValueError("level_v must not be 0: every sample would be an impact")
        if self.hysteresis_v >= abs(self.level_v):
            raise ValueError("hysteresis_v must be smaller than the size of level_v")
        if self.pre_trigger_s >= self.record_s:
            raise ValueError("pre_trigger_s must be shorter than record_s")
        return self


class ValveSection(Section):
    """The relay that breaks the vacuum, and the gauge that says whether a sphere hangs there."""

    driver: Literal["numato", "lcus"] = _choice("Kind of relay board")
    port: str | None = _choice(
        "Serial port, best a /dev/serial/by-id path; left out on the simulated rig", default=None
    )
    relay: int = _key("Number of the relay", ge=0, le=31, default=0)
    adc_channel: int | None = _choice(
        "Channel of the board's converter that reads the gauge", ge=0, le=31, default=None
    )
    adc_volts_per_code: float | None = _key(
        "Calibrated step of that converter (its reference is not documented)",
        "V",
        gt=0,
        where="measure two known voltages",
        default=None,
    )
    held_threshold_v: float | None = _key(
        "Gauge reading that separates a closed tube from an open one",
        "V",
        where="read the gauge with and without a sphere",
        default=None,
    )
    held_above: bool | None = _choice(
        "Whether a closed tube reads above the threshold", default=None
    )
    timeout_s: float = _key("Longest wait for an answer", "s", gt=0, le=10, default=0.5)

    @model_validator(mode="after")
    def _gauge_is_whole(self) -> ValveSection:
        gauge = {
            "adc_volts_per_code": self.adc_volts_per_code,
            "held_threshold_v": self.held_threshold_v,
            "held_above": self.held_above,
        }
        if self.driver == "lcus" and (
            self.adc_channel is not None or any(value is not None for value in gauge.values())
        ):
            raise ValueError("an LCUS-1 board has no converter: leave the gauge's keys out")
        if self.adc_channel is not None:
            missing = [name for name, value in gauge.items() if value is None]
            if missing:
                raise ValueError(
                    f"adc_channel is given, so {', '.join(missing)} must be too: "
                    "measure them on the rig, they have no default"
                )
        return self


class ReleaseSection(Section):
    """How well a release repeats, and what pulls the sphere."""

    gravity_m_per_s2: float = _key(
        "Local gravity", "m/s2", ge=9.7, le=9.9, where="look it up for your latitude and height"
    )
    speed_repeatability: float = _key(
        "Relative standard deviation of the impact speed from drop to drop",
        "1",
        gt=0,
        lt=0.5,
        where="repeat one drop ten times",
    )


class SensorSection(Section):
    """The load cell and its conditioner: nothing here has a default."""

    serial_number: str = _choice("Serial number of the cell", min_length=1)
    certificate: str = _choice(
        "Number or file of the certificate the values come from", min_length=1
    )
    compliance_m_per_v: MeasuredValue = _choice("Crystal compression per volt, c of Eq. 11", "m/V")
    crystal_mass_kg: MeasuredValue = _choice("Moving mass of the cell, M", "kg")
    crystal_stiffness_n_per_m: MeasuredValue = _choice("Stiffness of the crystal, k", "N/m")
    crystal_damping_n_s_per_m: MeasuredValue = _choice("Damping of the crystal, mu", "N.s/m")
    hsd_n_per_v: MeasuredValue = _choice(
        "Force per volt of the rigid-cell model, S of Eq. 7", "N/V"
    )

    @model_validator(mode="after")
    def _positive(self) -> SensorSection:
        for name in _SENSOR_QUANTITIES:
            quantity: MeasuredValue = getattr(self, name)
            if not (math.isfinite(quantity.value) and quantity.value > 0):
                raise ValueError(f"{name}.value must be positive, not {quantity.value:g}")
        return self

    def sensor(self) -> Sensor:
        """Return what the certificate knows, for the analysis."""
        return Sensor(
            compliance_m_per_v=self.compliance_m_per_v.quantity(),
            crystal_mass_kg=self.crystal_mass_kg.quantity(),
            crystal_stiffness_n_per_m=self.crystal_stiffness_n_per_m.quantity(),
            crystal_damping_n_s_per_m=self.crystal_damping_n_s_per_m.quantity(),
            hsd_n_per_v=self.hsd_n_per_v.quantity(),
        )


_SENSOR_QUANTITIES = (
    "compliance_m_per_v",
    "crystal_mass_kg",
    "crystal_stiffness_n_per_m",
    "crystal_damping_n_s_per_m",
    "hsd_n_per_v",
)
for _name in _SENSOR_QUANTITIES:
    _extra = SensorSection.model_fields[_name].json_schema_extra
    assert isinstance(_extra, dict)
    _extra["where"] = _CERTIFICATE
SensorSection.model_rebuild(force=True)


class PreflightSection(Section):
    """What must be true before the valve may open."""

    baseline_samples: int = _key(
        "Samples of the idle input that are looked at", "1", ge=1000, le=1_000_000, default=250_000
    )
    baseline_min_v: float = _key(
        "Lowest mean the idle input may have", "V", where="read the idle input for an hour"
    )
    baseline_max_v: float = _key(
        "Highest mean the idle input may have", "V", where="read the idle input for an hour"
    )
    noise_max_v: float = _key(
        "Largest standard deviation of the idle input",
        "V",
        gt=0,
        where="read the idle input for an hour",
    )
    noise_min_v: float = _key(
        "Smallest one; a dead input or an unplugged cell is quieter (0 switches it off)",
        "V",
        ge=0,
        default=0.0,
    )
    require_valid_calibration: bool = _choice(
        "Whether a drop is refused while no valid calibration exists", default=True
    )

    @model_validator(mode="after")
    def _ordered(self) -> PreflightSection:
        if self.baseline_min_v >= self.baseline_max_v:
            raise ValueError("baseline_min_v must be below baseline_max_v")
        if self.noise_min_v >= self.noise_max_v:
            raise ValueError("noise_min_v must be below noise_max_v")
        return self


class TimeoutsSection(Section):
    """How long each step may take, on the host's clock."""

    loading_s: float = _key("Wait for the sphere to be held", "s", gt=0, default=300.0)
    blind_loading_s: float = _key(
        "Time given to hang the sphere where no gauge can tell", "s", ge=0, default=10.0
    )
    held_stable_s: float = _key("The gauge must say held for this long", "s", ge=0, default=0.3)
    settle_s: float = _key(
        "Wait for a quiet input; the last sphere may still be bouncing",
        "s",
        ge=0,
        le=60,
        default=10.0,
    )
    impact_margin_s: float = _key(
        "Wait for the impact beyond the fall time", "s", gt=0, le=10, default=2.0
    )
    record_margin_s: float = _key(
        "Wait for the end of the record beyond its length", "s", gt=0, default=2.0
    )
    recover_every_s: float = _key(
        "Pause between attempts to reach a lost device", "s", gt=0, default=5.0
    )
    idle_check_every_s: float = _key(
        "Pause between looks at the valve while idle", "s", gt=0, default=1.0
    )


class JobsSection(Section):
    """The worker that fits."""

    fit_time_limit_s: float = _key("A fit that takes longer is ended", "s", gt=0, default=120.0)
    fit_memory_bytes: int = _key(
        "A fit that takes more memory is ended", "byte", ge=256_000_000, default=2_000_000_000
    )
    workers: int = _key("Worker processes", "1", ge=1, le=64, default=1)


class PlannedDrops(Section):
    """Drops of one reference sphere on one reference surface from one height."""

    sphere: str = _choice("Name in the materials file, marked as reference there")
    surface: str = _choice("Name in the materials file, marked as reference there")
    drop_height_m: float = _key("Height of the sphere's lowest point above the coupon", "m", gt=0)
    repeats: int = _key("How many", "1", ge=1, le=100, default=3)


class CalibrationSection(Section):
    """The scheduled calibration."""

    validity_days: float = _key("How long a calibration counts as valid", "d", gt=0, default=30.0)
    remind_days: float = _key("How long before its end it is called due", "d", ge=0, default=3.0)
    drift_limit_sigmas: float = _key(
        "Drift against the last calibration that raises an alarm, in standard deviations",
        "1",
        gt=0,
        default=3.0,
    )
    plan: Annotated[
        tuple[PlannedDrops, ...], Field(description="The drops of one calibration run, in order")
    ] = ()

    @model_validator(mode="after")
    def _ordered(self) -> CalibrationSection:
        if self.remind_days >= self.validity_days:
            raise ValueError("remind_days must be shorter than validity_days")
        return self


class MaterialsSection(Section):
    """Where spheres and surfaces are described."""

    file: Path = _choice(
        "The materials file; relative to this file", default=Path("materials.toml")
    )


class SimulationSection(Section):
    """The simulated rig; this section's presence selects it, and no hardware is touched."""

    seed: int = _key("Seed of everything drawn at random", ge=0, default=1)
    clock_speed: float = Field(
        description="Rig seconds per host second; inf runs as fast as the host reads [1]",
        json_schema_extra={"unit": "1"},
        gt=0,
        default=1.0,
    )
    effect: str = _choice(
        'What the instrument hides: "none", "random", or ids joined by "+"', default="none"
    )
    effect_parameters: dict[str, dict[str, float]] = _choice(
        "Parameters by effect id; those left out are drawn", default_factory=dict
    )
    technician_delay_s: float = _key(
        "Time the simulated technician takes to hang a sphere", "s", ge=0, default=0.0
    )
    noise_rms_v: float = _key("White noise of the input", "V", ge=0, default=1.5e-3)
