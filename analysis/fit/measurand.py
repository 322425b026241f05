"""A measured quantity as JSON, and how Young's modulus follows from a plane-strain one."""

from __future__ import annotations

import math

from analysis.aliases import Json
from analysis.campaign import Quantity
from analysis.written_numbers import K_95


def measurand(
    value: float,
    u: float,
    unit: str,
    *,
    log: bool = True,
    interval: tuple[float, float] | None = None,
) -> Json | None:
    """Return a measurand as JSON: value, standard and expanded uncertainty, 95 % interval.

    None where value or u would not be finite. The unit is in UCUM's spelling as far as it goes.
    With ``log`` a positive value's interval is symmetric in its logarithm, as fitted, rather than
    in the value. ``interval`` is the 95 % interval where it is known otherwise; an infinite end is
    null in JSON.
    """
    if not (math.isfinite(value) and math.isfinite(u)):
        return None
    if interval is not None:
        ends = interval
    elif log and value > 0:
        factor = math.exp(min(K_95 * u / value, 50.0))
        ends = (value / factor, value * factor)
    else:
        ends = (value - K_95 * u, value + K_95 * u)
    return {
        "value": float(value),
        "u": float(u),
        "unit": unit,
        "interval95": [float(x) if math.isfinite(x) else None for x in ends],
        "expanded": {"U": K_95 * float(u), "k": K_95, "coverage": 0.95},
    }


def young_from_plane_strain(
    log_plane: float, u_log: float, prior: Quantity | None, ratio: Quantity
) -> tuple[float, float]:
    """Return Young's modulus [Pa] and its relative standard uncertainty from a fitted E'.

    ``log_plane`` is ln E' with E' in Pa; ``prior`` is Young's modulus as stated beforehand [Pa],
    None if it is to be found.

    Source: ln E' = a + b with a = ln E and b = -ln(1 - nu^2) independent beforehand; the fit fixes
    their sum, the priors share it out. Without a prior on E all of u(b) goes to E. Validation:
    against sampling in ``tests/analysis/fit/test_result.py``.
    """
    b = -math.log(1 - ratio.value**2)
    var_b = (2 * ratio.value * ratio.u / (1 - ratio.value**2)) ** 2
    if prior is None:
        return math.exp(log_plane - b), math.sqrt(u_log**2 + var_b)
    var_a = (prior.u / prior.value) ** 2
    total = var_a + var_b
    if total == 0.0:
        return prior.value, 0.0
    share = var_a / total
    a = math.log(prior.value) + share * (log_plane - math.log(prior.value) - b)
    return math.exp(a), math.sqrt(var_a * var_b / total + (share * u_log) ** 2)


def as_quantity(measurand: Json) -> Quantity:
    """Return a measurand of our JSON as a Quantity."""
    return Quantity(float(measurand["value"]), float(measurand["u"]))
