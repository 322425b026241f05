"""What results look like on the wire."""

# ruff: noqa: N815 - units are written as SI writes them

from __future__ import annotations

from typing import Any

from pydantic import Field

from impactd.wire.answers import Answer


class ControlLimits(Answer):
    """Limits of a chart of individual values: mean +- 3 sigma, sigma from moving ranges."""

    centre_Pa: float
    lower_Pa: float
    upper_Pa: float
    outside: list[int] = Field(description="The latest shots outside the limits.")
    outside_count: int


class RelativeChange(Answer):
    """Change from the first shot to the last, by a line through all."""

    relative: float
    u: float


class PairResult(Answer):
    """What all shots of one sphere on one surface say."""

    sphere: str
    surface: str
    shots: int
    first_utc: str
    last_utc: str
    reduced_modulus_Pa: dict[str, Any] | None = Field(description="Weighted mean of all shots.")
    score: float | None = Field(
        description="How far the pair lies from what the network makes of it, in its own u; null "
        "where only this pair tells of its materials."
    )
    scatter_relative: float | None = Field(description="Standard deviation from shot to shot.")
    expected_scatter_relative: float = Field(
        description="What noise and speed alone would scatter, by the fits' own uncertainties."
    )
    trend: RelativeChange | None
    control: ControlLimits | None = Field(description="Null with fewer than eight shots.")


class ResultsAnswer(Answer):
    """Moduli by material, and every pair behind them."""

    model: str
    moduli: dict[str, Any]
    network: dict[str, Any] | None
    calibration: dict[str, Any]
    warnings: list[str]
    since: str | None
    until: str | None
    software: str
    shots: int = Field(description="So many take part.")
    pairs: list[PairResult]


class ChartAnswer(Answer):
    """A pair's control chart, oldest shot first."""

    sphere: str
    surface: str
    shots: int
    decimated: bool = Field(description="Whether shots within the limits are left out.")
    numbers: list[int]
    started_utc: list[str]
    reduced_modulus_Pa: list[float]
    u_Pa: list[float] = Field(description="Standard uncertainty of each shot by itself.")
    control: ControlLimits | None
