"""Temperature and humidity over the wire, in the keys of the campaign format."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from analysis.campaign import Environment, Quantity
from impactd.storage.ranges import RELATIVE_HUMIDITY, RELATIVE_RESOLUTION, TEMPERATURE_C


class _Reading(BaseModel):
    """A value with its standard uncertainty; rounding hides none of them beside any value."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False)
    value: float
    u: float


class TemperatureReading(_Reading):
    """A temperature with its standard uncertainty."""

    value: float = Field(ge=TEMPERATURE_C.low, le=TEMPERATURE_C.high, description="[degC]")
    u: float = Field(
        ge=RELATIVE_RESOLUTION * TEMPERATURE_C.high,
        le=TEMPERATURE_C.high,
        description="Standard uncertainty. [K]",
    )


class HumidityReading(_Reading):
    """A relative humidity with its standard uncertainty."""

    value: float = Field(
        ge=RELATIVE_HUMIDITY.low, le=RELATIVE_HUMIDITY.high, description="0.45 is 45 %. [1]"
    )
    u: float = Field(
        ge=RELATIVE_RESOLUTION * RELATIVE_HUMIDITY.high,
        le=RELATIVE_HUMIDITY.high,
        description="Standard uncertainty. [1]",
    )


def _no_plain_number(value: Any) -> Any:
    if isinstance(value, int | float) and not isinstance(value, bool):
        said = f'a reading has its standard uncertainty: write {{"value": {value:g}, "u": ...}}'
        raise ValueError(said)  # noqa: TRY004 - pydantic takes a ValueError only
    return value


_WithU = BeforeValidator(_no_plain_number)


class EnvironmentBody(BaseModel):
    """What it is like around the rig, as somebody read it."""

    model_config = ConfigDict(strict=True, extra="forbid")
    temperature_C: Annotated[TemperatureReading | None, _WithU] = Field(  # noqa: N815 - the unit's own capital
        None, description="Of spheres and coupons."
    )
    relative_humidity: Annotated[HumidityReading | None, _WithU] = Field(
        None, description="Of the air."
    )

    def environment(self) -> Environment | None:
        """Return the same as an analysis value, ``None`` where nothing is said."""
        found = Environment(_quantity(self.temperature_C), _quantity(self.relative_humidity))
        return None if found == Environment() else found


def _quantity(reading: _Reading | None) -> Quantity | None:
    return None if reading is None else Quantity(reading.value, reading.u)
