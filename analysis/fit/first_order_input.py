"""Inputs of a joint fit that act to first order: what one adds to each shot's record is known.

The error of an effect's law is one: each coefficient of its discrepancy was stated as 0, with a
standard uncertainty, and adds a signal to some shots. So are masses, radii and heights while a
search compares models: their errors are small, and their derivatives hardly depend on the model, so
that one derivative of each serves all fits.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from analysis.aliases import Array
from analysis.fit.fit_shot import FitShot
from analysis.fit.inputs import Input


@dataclass(frozen=True)
class FirstOrderInput(Input):
    """A number that was stated as 0 and adds so much of a known signal to each shot."""

    added: Mapping[float, Array] = field(default_factory=dict)
    """What a coordinate of 1 adds to each shot that has it, shape (n,), by the shot's place in the
    campaign. [unit of the signal]"""
    faster: Mapping[float, float] = field(default_factory=dict)
    """What it adds to the promised ln v0."""
    effect_id: str = ""
    """Whose law is inexact by it; empty for a stated number."""

    @property
    def scale(self) -> float:
        """Return the coordinate's change per unit of ``value``."""
        return 1.0

    @property
    def stated(self) -> float:
        """Return the coordinate where nothing is added."""
        return 0.0

    def value_at(self, coordinate: float) -> float:
        """Return the coefficient."""
        return coordinate

    def belongs_to(self, item: FitShot) -> bool:
        """Tell whether it adds something to this shot."""
        return item.frame.place in self.added

    def signal(self, item: FitShot) -> Array | None:
        """Return what it adds to a shot's record per unit."""
        return self.added[item.frame.place]

    def faster_by(self, item: FitShot) -> float:
        """Return what it adds to the promised ln v0 of a shot per unit."""
        return self.faster[item.frame.place]
