"""Does a modulus conform to a limit, with its uncertainty taken into account?

What is known of a modulus is a Gaussian on its logarithm, as its 95 % interval says; limits and
guard bands are therefore moved in the logarithm too. Below a few percent that is no difference.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.special import ndtr

from analysis.aliases import Json
from analysis.errors import AnalysisError
from analysis.written_numbers import K_95

RULES = {
    "both": "pass and fail both need the guard band; between them it is undecided",
    "acceptance": "a pass needs the guard band, all else fails",
    "rejection": "a fail needs the guard band, all else passes",
    "simple": "no guard band: the value itself is compared with the limits",
}
"""Decision rules: JCGM 106 8.3 on both sides, 8.3.2, 8.3.3 and 8.2."""
LEAST_LIMIT_PA = 1e3
"""Softer than any coupon that a sphere rebounds from; a smaller number is a limit in GPa."""
NAMES = {"youngs_modulus_Pa": "E", "plane_strain_modulus_Pa": "E/(1-nu^2)"}


@dataclass(frozen=True)
class Limits:
    """What was asked of a modulus, and how it is decided.

    An AnalysisError says that no limit is given, that one is no modulus, or that they leave nothing
    between them.
    """

    lower_pa: float | None = None
    upper_pa: float | None = None
    """Tolerance limits, ``lower_pa`` and this; at least one. [Pa]"""
    rule: str = "both"
    """One of `RULES`."""
    guard_factor: float = 1.0
    """Guard band over the expanded uncertainty (95 %): r of w = r U. 1 asks that the whole 95 %
    interval conforms."""

    def __post_init__(self) -> None:
        given = [one for one in (self.lower_pa, self.upper_pa) if one is not None]
        if not given:
            raise AnalysisError("There is nothing to decide: give a lower or an upper limit.")
        for one in given:
            if not (math.isfinite(one) and one >= LEAST_LIMIT_PA):
                raise AnalysisError(
                    f"A limit of {one:g} Pa is no modulus of a solid; limits are in pascal, so "
                    "2.2 GPa is 2.2e9."
                )
        if len(given) == 2 and given[0] >= given[1]:
            raise AnalysisError(
                f"The lower limit ({given[0]:g} Pa) is not below the upper one ({given[1]:g} Pa)."
            )
        if self.rule not in RULES:
            raise AnalysisError(f"There is no rule {self.rule!r}; choose {', '.join(RULES)}.")
        if not 0 <= self.guard_factor <= 10:
            raise AnalysisError(f"A guard factor of {self.guard_factor:g} is not within 0 .. 10.")

    @property
    def ends(self) -> tuple[float, float]:
        """Return both limits; 0 and infinity where none was given. [Pa]"""
        low = 0.0 if self.lower_pa is None else self.lower_pa
        return low, math.inf if self.upper_pa is None else self.upper_pa


def probability_between(estimate: float, u: float, lower: float, upper: float) -> float:
    r"""Return the probability that a Gaussian quantity lies between two limits.

    .. math:: p_c = \Phi\left(\frac{T_U - y}{u}\right) - \Phi\left(\frac{T_L - y}{u}\right)

    A limit is infinite if there is none. Source: JCGM 106:2012, 7.2 to 7.4. Validation: its Table
    1, its Zener diode and its motor oil in ``tests/analysis/test_conformity.py``, and draws.
    """
    if u == 0.0:
        return float(lower <= estimate <= upper)
    low, high = (lower - estimate) / u, (upper - estimate) / u
    # the same difference from the other side, where both terms are near 1 and would cancel
    return float(ndtr(-low) - ndtr(-high) if low > 0 else ndtr(high) - ndtr(low))


def judge(name: str, value_pa: float, relative_u: float, limits: Limits) -> Json:
    """Decide whether a modulus conforms.

    The result has ``decision`` (``pass``, ``fail`` or ``undecided``), ``probability`` of
    conformity, the limits of acceptance and of rejection, the risk of a wrong decision, and a
    ``sentence``. Source: JCGM 106:2012, 8.2 and 8.3: w = r U, with U of 95 % (k = 1.96, where its
    examples take 2).
    """
    low, high = limits.ends
    # only logarithms are compared; a limit that was not given is infinitely far
    logs = -math.inf if low == 0 else math.log(low), math.log(high)
    probability = probability_between(math.log(value_pa), relative_u, *logs)
    band = 0.0 if limits.rule == "simple" else limits.guard_factor * K_95 * relative_u
    inner = low * math.exp(band), high * math.exp(-band)
    outer = low * math.exp(-band), high * math.exp(band)
    if limits.rule == "rejection":
        inner = outer
    if limits.rule == "acceptance":
        outer = inner
    passes, fails = inner[0] <= value_pa <= inner[1], not outer[0] <= value_pa <= outer[1]
    decision = "pass" if passes else "fail" if fails else "undecided"
    wrong = {"pass": 1 - probability, "fail": probability, "undecided": None}[decision]
    verb = {"pass": "passes", "fail": "fails", "undecided": "is undecided"}[decision]
    sentence = _sentence(f"{name} {verb}", limits, probability, band, inner)
    if decision == "undecided":
        sentence += " A smaller uncertainty would decide it."
    return {
        "lower_Pa": limits.lower_pa,
        "upper_Pa": limits.upper_pa,
        "rule": limits.rule,
        "guard_factor": limits.guard_factor,
        "guard_band_relative": band,
        "passes_within_Pa": _given(inner),
        "fails_outside_Pa": _given(outer),
        "probability": probability,
        "decision": decision,
        "risk_of_wrong_decision": wrong,
        "sentence": sentence,
    }


def _given(ends: tuple[float, float]) -> list[float | None]:
    return [ends[0] or None, ends[1] if math.isfinite(ends[1]) else None]


def _sentence(
    said: str, limits: Limits, probability: float, band: float, inner: tuple[float, float]
) -> str:
    said += f": {_asked(*limits.ends)} was asked"
    width = f"{100 * band:.3g} %"
    if inner[0] > inner[1]:
        said += f"; the guard band of {width} is wider than what is asked, so nothing can pass"
    elif band > 0 and limits.rule != "rejection":
        said += f", which with a guard band of {width} takes a value of {_asked(*inner)}"
    elif band > 0:
        said += f", and a fail takes a value that is {width} beyond"
    return said + f". It conforms with a probability of {_chance(probability)}."


def _asked(low: float, high: float) -> str:
    if low == 0:
        return f"at most {_pascals(high)}"
    if not math.isfinite(high):
        return f"at least {_pascals(low)}"
    return f"{_pascals(low)} to {_pascals(high)}"


def _pascals(value: float) -> str:
    units = ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"))
    factor, unit = next((one for one in units if value >= one[0]), (1.0, "Pa"))
    return f"{value / factor:.5g} {unit}"


def _chance(p: float) -> str:
    """Return a probability that is never called certain."""
    if p > 0.9999:
        return "more than 99.99 %"
    if p < 1e-4:
        return "less than 0.01 %"
    return f"{100 * p:.3g} %" if p < 0.99 else f"{100 * p:.2f} %"


def decide(budget: Json, material: str, measurand: str, limits: Limits) -> None:
    """Write a decision into ``impactd-budget/1``, under ``conformity`` of one modulus.

    ``budget``, of all moduli, is changed in place; ``measurand`` is ``youngs_modulus_Pa`` or
    ``plane_strain_modulus_Pa``. An AnalysisError says that the budget does not have that modulus.
    """
    one = budget["moduli"].get(material, {}).get(measurand)
    if one is None:
        raise AnalysisError(
            f"{NAMES[measurand]} of {material} is not stated here, so nothing can be decided. It "
            f"is stated for: {', '.join(n for n, m in budget['moduli'].items() if measurand in m)}."
        )
    name = f"{NAMES[measurand]} of {material}"
    one["conformity"] = judge(name, one["value"], one["relative_u"], limits)
