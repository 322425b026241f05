"""A shot's own parameters: what is known of those that effects bring, and their transfer."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from analysis.aliases import Array
from analysis.effects.effect import EffectParameter
from analysis.fit.priors import UNKNOWN_LOG_U, Prior
from analysis.model.impact_model import ImpactModel

COORDINATE_U = 20.0
"""Width, in coordinates, that only keeps a shot's own number finite."""


def prior_of(parameter: EffectParameter) -> Prior:
    """Return what is known of a shot's own number before the shot: next to nothing.

    In its coordinate: about neutral, or about the first start of a logarithm.
    """
    if parameter.form == "log":
        return Prior(parameter.coordinate(parameter.starts[0]), UNKNOWN_LOG_U)
    return Prior(0.0, COORDINATE_U)


def fresh(model: ImpactModel, shots: int, starts: Mapping[str, float] | None = None) -> Array:
    """Return nuisances to start from: effects' numbers at their starts, all else zero.

    Shape (shots, q), in the order of ``model.nuisances``. ``starts`` has coordinates by name,
    ``<effect>.<parameter>``, where the effect's own start is not wanted.
    """
    found = np.zeros((shots, len(model.nuisances)))
    for at, parameter in model.of_shot:
        name = model.names[at]
        start = parameter.coordinate(parameter.starts[0])
        found[:, at - len(model.shared)] = (starts or {}).get(name, start)
    return found


def carried_over(
    old: ImpactModel, new: ImpactModel, nuisances: Array, starts: Mapping[str, float] | None = None
) -> Array:
    """Return one model's nuisances as another's, which has more effects or fewer.

    Their shapes are (shots, q) and (shots, r). What both models have keeps its values, whatever its
    place; what is new starts as in `fresh`.
    """
    found = fresh(new, nuisances.shape[0], starts)
    for at, name in enumerate(new.nuisances):
        if name in old.nuisances:
            found[:, at] = nuisances[:, old.nuisances.index(name)]
    return found
