"""The sections of the settings file that describe the instrument: what is wired to what.

Nothing here that must be measured has a default. `settings.py` puts the sections together.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Discriminator, Tag, field_validator, model_validator

from impactd.settings.keys import MeasuredValue, Section, choice, key

if TYPE_CHECKING:
    from analysis.campaign import Sensor

_CERTIFICATE = "take it from the load cell's certificate or from a calibration"
_ENUMERATION = "read it with `lsusb` while the board is plugged in"


class RigSection(Section):
    """What the rig is and what may be asked of it."""

    name: str = choice("Name of the rig, written into every shot", min_length=1, max_length=80)
    unattended_safe: bool = choice(
        "Whether a responsible person has agreed that spheres are dropped with nobody present",
        default=False,
    )
    min_drop_height_m: float = key("Smallest height the stand allows", "m", gt=0, default=0.002)
    max_drop_height_m: float = key(
        "Greatest height the stand allows", "m", gt=0, le=5.0, where="measure it on the stand"
    )

    @model_validator(mode="after")
    def _ordered(self) -> RigSection:
        if self.min_drop_height_m >= self.max_drop_height_m:
            raise ValueError("min_drop_height_m must be smaller than max_drop_height_m")
        return self


class StreamingSection(Section):
    """What the settings say of every digitizer: which one, its calibrated rate, its buffers."""

    serial_number: str | None = choice(
        "Serial number, where two boards are plugged in", default=None
    )
    fpga_file: Path | None = choice(
        "Bit stream for the FPGA, supplied by you; relative to this file", default=None
    )
    sample_rate_hz: float = key(
        "Calibrated sample rate, not the nominal one",
        "Hz",
        gt=0,
        where="measure it against a frequency standard",
    )
    sample_rate_u_hz: float = key(
        "Standard uncertainty of that rate",
        "Hz",
        gt=0,
        where="it comes with the rate's calibration",
    )
    ring_seconds: float = key("Length of the ring buffer", "s", gt=0, le=60, default=4.0)
    transfer_bytes: int = key(
        "Size of one bulk read, a multiple of 512", "byte", ge=512, multiple_of=512, default=16384
    )
    wire_log_file: Path | None = choice(
        "Where to write every USB transfer, for the first run with a new board", default=None
    )

    def _check_rate(self, pacer_clock_hz: float, pacer_divisor: int) -> None:
        nominal_hz = pacer_clock_hz / (pacer_divisor + 1)
        # Measured clocks are off by up to 1 %; 5 % is a slip of the pen.
        if abs(self.sample_rate_hz / nominal_hz - 1) > 0.05:
            raise ValueError(
                f"sample_rate_hz = {self.sample_rate_hz:g} Hz is more than 5 % away from the "
                f"{nominal_hz:g} Hz that pacer_divisor = {pacer_divisor} asks for"
            )


class Daq3500Section(StreamingSection):
    """The Omega OMB-DAQ-3500: identity on the bus, input, and its calibrated rate."""

    driver: Literal["daq3500"] = choice("Kind of digitizer", default="daq3500")
    vendor_id: int = key("USB vendor id", where=_ENUMERATION, ge=1, le=0xFFFF)
    product_id_unloaded: int = key(
        "USB product id before the firmware is loaded", where=_ENUMERATION, ge=1, le=0xFFFF
    )
    product_id_loaded: int = key(
        "USB product id once the firmware runs", where=_ENUMERATION, ge=1, le=0xFFFF
    )
    firmware_file: Path | None = choice(
        "Intel-hex image for the FX2, supplied by you; relative to this file", default=None
    )
    channel: int = key(
        "Analogue input the conditioner is wired to",
        ge=0,
        le=127,
        where="look where the cable goes",
    )
    differential: bool = choice(
        "Whether that input is wired differentially",
    )
    range_v: float = key(
        "Input range, +/-; one of 10, 5, 2, 1, 0.5, 0.2, 0.1",
        "V",
        where="the smallest that holds the largest impact",
    )
    settling_us: Literal[1, 5, 10, 1000] = choice(
        "Settling time code of the scan entry", "us", default=1
    )
    pacer_divisor: int = key(
        "N of f = 48 MHz / (N + 1); 47 is 1 MHz", ge=1, le=2**31 - 1, default=47
    )

    @field_validator("range_v")
    @classmethod
    def _known_range(cls, value: float) -> float:
        if value not in (10.0, 5.0, 2.0, 1.0, 0.5, 0.2, 0.1):
            raise ValueError("the board has the ranges 10, 5, 2, 1, 0.5, 0.2 and 0.1 V only")
        return value

    @model_validator(mode="after")
    def _plausible_rate(self) -> Daq3500Section:
        self._check_rate(48e6, self.pacer_divisor)
        return self


class Usb2637Section(StreamingSection):
    """The MCC USB-2637: input, and its calibrated rate."""

    driver: Literal["usb2637"] = choice("Kind of digitizer", default="usb2637")
    channel: int = key(
        "Analogue input the conditioner is wired to",
        ge=0,
        le=63,
        where="look where the cable goes",
    )
    range_v: float = key("Input range, +/-; the board has one", "V", default=10.0)
    pacer_divisor: int = key(
        "N of f = 64 MHz / (N + 1): 63 is 1 MHz, 127 is 500 kHz, 639 is 100 kHz", default=63
    )

    @field_validator("range_v")
    @classmethod
    def _known_range(cls, value: float) -> float:
        if value != 10.0:
            raise ValueError(f"the board has the range +/-10 V only, not {value:g} V: set 10.0")
        return value

    @field_validator("pacer_divisor")
    @classmethod
    def _known_rate(cls, value: int) -> int:
        if value < 63:
            raise ValueError(
                f"{value} asks for more than the board's 1 MHz: set 63 for 1 MHz, 127 for 500 kHz"
            )
        if value > 639:
            raise ValueError(
                f"{value} asks for {64e3 / (value + 1):.3g} kHz, which leaves less than ten "
                "samples of an impact of 100 us: set 639 (100 kHz) or less, best 63 (1 MHz)"
            )
        return value

    @model_validator(mode="after")
    def _plausible_rate(self) -> Usb2637Section:
        self._check_rate(64e6, self.pacer_divisor)
        return self


def _driver_of(section: Any) -> str:
    """Return which digitizer a table describes; one without ``driver`` is of the first kind."""
    if isinstance(section, dict):
        return str(section.get("driver", "daq3500"))
    return str(getattr(section, "driver", ""))


DigitizerSection = Annotated[
    Annotated[Daq3500Section, Tag("daq3500")] | Annotated[Usb2637Section, Tag("usb2637")],
    Discriminator(_driver_of),
]
"""The digitizer, of the kind that its ``driver`` names."""


class TriggerSection(Section):
    """When a record begins and how long it is."""

    level_v: float = key(
        "Level above the baseline that starts a record; its sign is the slope",
        "V",
        where="well above the noise, well below the softest impact",
    )
    hysteresis_v: float = key(
        "The signal must have been this far below the level",
        "V",
        gt=0,
        where="several times the noise",
    )
    pre_trigger_s: float = key("Kept before the trigger", "s", ge=0.001, le=1.0, default=0.020)
    record_s: float = key(
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

    driver: Literal["numato", "lcus"] = choice("Kind of relay board")
    port: str | None = choice(
        "Serial port, best a /dev/serial/by-id path; left out on the simulated rig", default=None
    )
    relay: int = key("Number of the relay", ge=0, le=31, default=0)
    adc_channel: int | None = choice(
        "Channel of the board's converter that reads the gauge", ge=0, le=31, default=None
    )
    adc_volts_per_code: float | None = key(
        "Calibrated step of that converter (its reference is not documented)",
        "V",
        gt=0,
        where="measure two known voltages",
        default=None,
    )
    held_threshold_v: float | None = key(
        "Gauge reading that separates a closed tube from an open one",
        "V",
        where="read the gauge with and without a sphere",
        default=None,
    )
    held_above: bool | None = choice(
        "Whether a closed tube reads above the threshold", default=None
    )
    timeout_s: float = key("Longest wait for an answer", "s", gt=0, le=10, default=0.5)

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

    gravity_m_per_s2: float = key(
        "Local gravity", "m/s2", ge=9.7, le=9.9, where="look it up for your latitude and height"
    )
    speed_repeatability: float = key(
        "Relative standard deviation of the impact speed from drop to drop",
        "1",
        gt=0,
        lt=0.5,
        where="repeat one drop ten times",
    )
    height_offset_u_m: float = key(
        "Standard uncertainty of an offset that all drop heights share",
        "m",
        ge=0,
        lt=0.01,
        default=0.0,
        where="how well tube end and coupon are set against the scale; 0 counts as exact",
    )


class SensorSection(Section):
    """The load cell and its conditioner: nothing here has a default."""

    serial_number: str = choice("Serial number of the cell", min_length=1)
    certificate: str = choice(
        "Number or file of the certificate the values come from", min_length=1
    )
    compliance_m_per_v: MeasuredValue = choice("Crystal compression per volt, c of Eq. 11", "m/V")
    crystal_mass_kg: MeasuredValue = choice("Moving mass of the cell, M", "kg")
    crystal_stiffness_n_per_m: MeasuredValue = choice("Stiffness of the crystal, k", "N/m")
    crystal_damping_n_s_per_m: MeasuredValue = choice("Damping of the crystal, mu", "N.s/m")
    hsd_n_per_v: MeasuredValue = choice("Force per volt of the rigid-cell model, S of Eq. 7", "N/V")

    @model_validator(mode="after")
    def _positive(self) -> SensorSection:
        for name in _SENSOR_QUANTITIES:
            quantity: MeasuredValue = getattr(self, name)
            if not (math.isfinite(quantity.value) and quantity.value > 0):
                raise ValueError(f"{name}.value must be positive, not {quantity.value:g}")
        return self

    def sensor(self) -> Sensor:
        """Return what the certificate knows, for the analysis."""
        # Imported here: whoever only makes the valve safe must not wait for numpy.
        from analysis.campaign import Sensor  # noqa: PLC0415

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
