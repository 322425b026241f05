"""The sections of the settings file that say what the daemon does and when.

`instrument.py` describes the rig; `settings.py` puts the sections together.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, model_validator

from impactd.settings.keys import MeasuredValue, Section, choice, key
from impactd.storage.ranges import RELATIVE_HUMIDITY, RELATIVE_RESOLUTION, TEMPERATURE_C

if TYPE_CHECKING:
    from analysis.campaign import Environment


class ServerSection(Section):
    """Where the REST service listens."""

    host: str = choice(
        "Address to listen on; anything but loopback needs a proxy with TLS", default="127.0.0.1"
    )
    port: int = choice("TCP port; 0 takes a free one", ge=0, le=65535, default=8642)
    allowed_hosts: tuple[str, ...] = choice(
        "Host names a request may carry", default=("127.0.0.1", "localhost", "[::1]")
    )


class StorageSection(Section):
    """Where shots are kept."""

    directory: Path = choice("Folder of the archive; relative to the working directory")
    reserve_bytes: int = key(
        "Free space below which no drop is started", "byte", ge=0, default=1_000_000_000
    )
    rescue_directory: Path | None = choice(
        "Folder on another disk for a record that the archive's disk does not take when the daemon "
        "must end",
        default=None,
    )


class PreflightSection(Section):
    """What must be true before the valve may open."""

    baseline_samples: int = key(
        "Samples of the idle input that are checked", "1", ge=1000, le=1_000_000, default=250_000
    )
    baseline_min_v: float = key(
        "Lowest mean the idle input may have", "V", where="read the idle input for an hour"
    )
    baseline_max_v: float = key(
        "Highest mean the idle input may have", "V", where="read the idle input for an hour"
    )
    noise_max_v: float = key(
        "Largest standard deviation of the idle input",
        "V",
        gt=0,
        where="read the idle input for an hour",
    )
    noise_min_v: float = key(
        "Smallest one; a dead input or an unplugged cell is quieter (0 switches it off)",
        "V",
        ge=0,
        default=0.0,
    )
    require_valid_calibration: bool = choice(
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

    loading_s: float = key("Wait for the sphere to be held", "s", gt=0, default=300.0)
    blind_loading_s: float = key(
        "Time given to hang the sphere if there is no gauge", "s", ge=0, default=10.0
    )
    held_stable_s: float = key("The gauge must say held for this long", "s", ge=0, default=0.3)
    settle_s: float = key(
        "Wait for a quiet input; the last sphere may still be bouncing",
        "s",
        ge=0,
        le=60,
        default=10.0,
    )
    impact_margin_s: float = key(
        "Wait for the impact beyond the fall time", "s", gt=0, le=10, default=2.0
    )
    record_margin_s: float = key(
        "Wait for the end of the record beyond its length", "s", gt=0, default=2.0
    )
    recover_every_s: float = key(
        "Pause between attempts to reach a lost device", "s", gt=0, default=5.0
    )
    idle_check_every_s: float = key(
        "Pause between checks of the valve while idle", "s", gt=0, default=1.0
    )


class JobsSection(Section):
    """The worker that fits."""

    fit_time_limit_s: float = key("A fit that takes longer is ended", "s", gt=0, default=120.0)
    fit_memory_bytes: int = key(
        "A fit that takes more memory is ended", "byte", ge=256_000_000, default=2_000_000_000
    )
    workers: int = key(
        "Worker processes, which share all cores but one", "1", ge=1, le=64, default=1
    )


class PlannedDrops(Section):
    """Drops of one reference sphere on one reference surface from one height."""

    sphere: str = choice("Name in the materials file, marked as reference there")
    surface: str = choice("Name in the materials file, marked as reference there")
    drop_height_m: float = key("Height of the sphere's lowest point above the coupon", "m", gt=0)
    repeats: int = key("How many", "1", ge=1, le=100, default=3)


class CalibrationSection(Section):
    """The scheduled calibration."""

    validity_days: float = key("How long a calibration counts as valid", "d", gt=0, default=30.0)
    remind_days: float = key(
        "How long before its end it is reported as due", "d", ge=0, default=3.0
    )
    drift_limit_sigmas: float = key(
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

    file: Path = choice("The materials file; relative to this file", default=Path("materials.toml"))


class EnvironmentSection(Section):
    """Where temperature and humidity of a drop come from, in exactly one of three ways."""

    temperature_C: MeasuredValue | None = choice(  # noqa: N815 - the unit's own capital
        "Temperature of spheres and coupons, always the same", "degC", default=None
    )
    relative_humidity: MeasuredValue | None = choice(
        "Relative humidity of the air, always the same; 0.45 is 45 %", "1", default=None
    )
    file: Path | None = choice(
        "JSON file with these two keys, which a sensor's own program keeps writing; relative to "
        "this file",
        default=None,
    )
    max_age_s: float | None = key("An older file is not used", "s", gt=0, default=None)
    command: tuple[Annotated[str, Field(min_length=1)], ...] | None = choice(
        "Program and arguments that print such JSON, run before each drop",
        min_length=1,
        default=None,
    )
    command_limit_s: float = key(
        "A command that takes longer is ended", "s", gt=0, le=60, default=5.0
    )

    @property
    def is_constant(self) -> bool:
        """Whether both values are fixed in the settings."""
        return self.file is None and self.command is None

    def constant(self) -> Environment:
        """Return the fixed values."""
        # Imported here: whoever only makes the valve safe must not wait for numpy.
        from analysis.campaign import Environment  # noqa: PLC0415

        temperature, humidity = self.temperature_C, self.relative_humidity
        return Environment(
            None if temperature is None else temperature.quantity(),
            None if humidity is None else humidity.quantity(),
        )

    @model_validator(mode="after")
    def _one_way(self) -> EnvironmentSection:
        ways = {
            "constants": (self.temperature_C or self.relative_humidity) is not None,
            "file": self.file is not None,
            "command": self.command is not None,
        }
        named = [way for way, given in ways.items() if given]
        if len(named) != 1:
            found = " and ".join(named) or "none"
            raise ValueError(
                "exactly one of three ways is needed: constants (temperature_C, "
                f"relative_humidity), a file, or a command; given: {found}"
            )
        if (self.file is None) != (self.max_age_s is None):
            raise ValueError(
                "file and max_age_s belong together: max_age_s is the largest age of a reading"
            )
        if self.command is None and "command_limit_s" in self.model_fields_set:
            raise ValueError("command_limit_s belongs to command, which is missing")
        return self

    @model_validator(mode="after")
    def _possible(self) -> EnvironmentSection:
        for name, within in (
            ("temperature_C", TEMPERATURE_C),
            ("relative_humidity", RELATIVE_HUMIDITY),
        ):
            given: MeasuredValue | None = getattr(self, name)
            if given is None:
                continue
            if not within.low <= given.value <= within.high:
                raise ValueError(f"{name}.value is {given.value:g}; it must be {within}")
            least = RELATIVE_RESOLUTION * (abs(given.value) or 1.0)
            if not least <= given.u <= max(abs(within.low), abs(within.high)):
                raise ValueError(
                    f"{name}.u is {given.u:g}, which is no standard uncertainty of {given.value:g}"
                )
        return self


class SimulationSection(Section):
    """The simulated rig; this section's presence selects it, and no hardware is touched."""

    seed: int = key("Seed of all random draws", ge=0, default=1)
    clock_speed: float = Field(
        description="Rig seconds per host second; inf runs as fast as the host reads [1]",
        json_schema_extra={"unit": "1"},
        gt=0,
        default=1.0,
    )
    rig: Literal["paper", "closed", "drawn"] | None = choice(
        'Physics of the rig: "paper" as printed, "closed" with every law kept, or "drawn" from '
        "the seed; without it the simulator's default",
        default=None,
    )
    labels: Literal["exact", "typical"] = choice(
        'Whether radii, masses, heights and time base are as stated, or drawn around it: "exact" '
        'or "typical"',
        default="exact",
    )
    effect: str = choice(
        'What the instrument hides: "none", "random", or ids joined by "+"', default="none"
    )
    effect_parameters: dict[str, dict[str, float]] = choice(
        "Parameters by effect id; those left out are drawn", default_factory=dict
    )
    technician_delay_s: float = key(
        "Time the simulated technician takes to hang a sphere", "s", ge=0, default=0.0
    )
    noise_rms_v: float = key("White noise of the input", "V", ge=0, default=1.5e-3)
