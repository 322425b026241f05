"""What models, effects, the rig and moduli look like on the wire."""

# ruff: noqa: N815 - units are written as SI writes them

from __future__ import annotations

from typing import Any

from pydantic import ConfigDict, Field

from impactd.wire.answers import Answer


class ModelItem(Answer):
    """A base model, or one version of a named one."""

    model_config = ConfigDict(extra="allow")
    name: str
    version: int | None
    active: bool = Field(description="Later fits use it, and results are reported with it.")


class ModelChoice(Answer):
    """Since when a model was the active one."""

    name: str
    since_utc: str


class ModelsAnswer(Answer):
    """All models, bases first."""

    active: str
    active_version: int | None
    items: list[ModelItem]
    history: list[ModelChoice]


class EffectParameterAnswer(Answer):
    """A parameter of an effect."""

    name: str
    unit: str
    description: str
    belongs_to: str
    low: float | None
    high: float | None
    neutral: str | None = Field(description="Where the effect vanishes.")
    starts: list[float]


class EffectAnswer(Answer):
    """An effect of the library."""

    id: str
    slot: str
    title: str
    tell_tale: str
    source: str
    validation: str
    parameters: list[EffectParameterAnswer]
    free_sizes_per_shot: int
    needs: list[str]
    bases: list[str]
    replaces_base: str | None
    by_name: bool
    variants: list[EffectAnswer]


class EffectsAnswer(Answer):
    """The effect library."""

    items: list[EffectAnswer]


class RigSphere(Answer):
    """A sphere that a drop may name."""

    name: str
    diameter_m: float | None
    mass_kg: float | None
    reference: bool


class RigSurface(Answer):
    """A surface that a drop may name."""

    name: str
    reference: bool


class PlannedDrops(Answer):
    """Some equal drops of the calibration's plan."""

    sphere: str
    surface: str
    drop_height_m: float
    repeats: int


class RigAnswer(Answer):
    """What may be asked of the rig."""

    name: str
    simulated: bool
    spheres: list[RigSphere]
    surfaces: list[RigSurface]
    min_drop_height_m: float
    max_drop_height_m: float
    record_s: float
    loading_s: float
    calibration_plan: list[PlannedDrops]
    remind_days: float


class Interval(Answer):
    """A value with its uncertainty."""

    model_config = ConfigDict(extra="allow")
    value: float
    u: float = Field(description="Standard uncertainty.")
    unit: str
    interval95: list[float] | None = None


class MaterialModulus(Answer):
    """What all shots say of one material."""

    model_config = ConfigDict(extra="allow")
    youngs_modulus_Pa: Interval | None
    plane_strain_modulus_Pa: Interval | None
    side: str
    status: str = Field(description="fitted, reference or withheld.")
    stated_youngs_modulus_Pa: dict[str, Any] | None = Field(
        default=None, description="Of a reference: as it was stated beforehand."
    )
    calibration_overdue: bool


class ModuliDocument(Answer):
    """``impactd-moduli/1``."""

    model_config = ConfigDict(extra="allow")
    format: str
    model: str
    moduli: dict[str, MaterialModulus]
    pairs: dict[str, dict[str, Any]]
    network: dict[str, Any] | None
    covariance: dict[str, Any] | None
    calibrations: list[str]
    warnings: list[str]
    calibration: dict[str, Any]
    shots: list[dict[str, Any]]
    excluded: list[dict[str, Any]]
    software: str
