"""The description of one key of the settings file: meaning, unit, limits, and its source.

A key that must be measured, read off a certificate or looked up on the rig has no default, and
its ``json_schema_extra["where"]`` says where its value comes from; the message for a missing key
quotes it. Keys that are choices have defaults.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pydantic import BaseModel, ConfigDict, Field

if TYPE_CHECKING:
    from analysis.campaign import Quantity


def key(meaning: str, unit: str = "", *, where: str = "", **limits: Any) -> Any:
    """Describe one key; without ``default`` among the limits it is required."""
    extra: dict[str, Any] = {}
    if unit:
        extra["unit"] = unit
    if where:
        extra["where"] = where
    text = f"{meaning} [{unit}]" if unit else meaning
    return Field(description=text, json_schema_extra=extra or None, allow_inf_nan=False, **limits)


def choice(meaning: str, unit: str = "", **limits: Any) -> Any:
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

    value: float = key("Best estimate, in the unit of the key")
    u: float = key("Standard uncertainty (k = 1), in the unit of the key", gt=0)

    def quantity(self) -> Quantity:
        """Return the value for the analysis."""
        # Imported here: whoever only makes the valve safe must not wait for numpy.
        from analysis.campaign import Quantity  # noqa: PLC0415

        return Quantity(self.value, self.u)
