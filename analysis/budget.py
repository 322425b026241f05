"""The uncertainty budget of every modulus of a joint fit: ``impactd-budget/1``.

Each row is one source with its sensitivity coefficient and contribution; the squares of all
contributions add up to the modulus' own. What all shots share stands apart from what more shots
would lessen, and a sentence says what would improve the modulus most.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.aliases import Array, Json
from analysis.budget_advice import advice
from analysis.budget_sources import Source, nu_slope, sources
from analysis.campaign import Quantity, Sphere, Surface
from analysis.fit.joint import Fitted
from analysis.fit.measurand import young_from_plane_strain
from analysis.fit.problem import JointProblem
from analysis.parameters import ParameterName, key_in_moduli

FORMAT = "impactd-budget/1"
PLANE, YOUNG = "plane_strain_modulus_Pa", "youngs_modulus_Pa"
NEGLIGIBLE = 1e-12
"""Share of the variance below which a row is left out: what rounding leaves."""


@dataclass(frozen=True)
class Row:
    """One source's line."""

    source: Source
    parts: Array
    """Change of the modulus' logarithm by each independent standard deviation of the source. Shape
    (r,). [1]"""

    @property
    def contribution(self) -> float:
        """Return the relative standard uncertainty that the source alone would leave. [1]"""
        return math.sqrt(float(self.parts @ self.parts))

    @property
    def sensitivity(self) -> float | None:
        """Return d ln(modulus) / d ln(source), or / d source; None where it is no number."""
        said, value = self.source.uncertainty.u, self.source.value
        if self.parts.size != 1 or value is None or not said > 0:
            return None
        return float(self.parts[0]) / (said / value if self.source.relative else said)


@dataclass(frozen=True)
class Budget:
    """What the uncertainty of one modulus is made of."""

    name: ParameterName
    """The global."""
    measurand: str
    """Which of its moduli."""
    value: float
    """[Pa]"""
    rows: tuple[Row, ...]
    """Largest contribution first."""

    @property
    def relative_u(self) -> float:
        """Return the combined relative standard uncertainty. [1]"""
        return math.sqrt(sum(r.contribution**2 for r in self.rows))

    def part(self, *, common: bool) -> float:
        """Return the relative standard uncertainty of what all shots share, or do not. [1]"""
        return math.sqrt(sum(r.contribution**2 for r in self.rows if r.source.common == common))

    @property
    def degrees_of_freedom(self) -> float:
        """Return the effective degrees of freedom (Welch-Satterthwaite, JCGM 100 G.4.1)."""
        spent = sum(r.contribution**4 / r.source.uncertainty.degrees_of_freedom for r in self.rows)
        return self.relative_u**4 / spent if spent > 0 else math.inf

    def advice(self) -> str:
        """Return what would improve the modulus most, in a sentence."""
        return advice(self)

    def to_json(self) -> Json:
        """Return the budget as ``impactd-budget/1``; NaN and infinity never appear."""
        total = self.relative_u
        return {
            "format": FORMAT,
            "material": self.name.owner,
            "measurand": self.measurand,
            "value": self.value,
            "u": self.value * total,
            "unit": "Pa",
            "relative_u": total,
            "relative_u_common": self.part(common=True),
            "relative_u_averaged": self.part(common=False),
            "effective_degrees_of_freedom": _finite(self.degrees_of_freedom),
            "rows": [_row_json(r, total) for r in self.rows],
            "improve": self.advice(),
        }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _row_json(row: Row, total: float) -> Json:
    source = row.source
    return {
        "input": source.name,
        "label": source.label,
        "value": source.value,
        "u": _finite(source.uncertainty.u),
        "unit": source.unit,
        "distribution": source.uncertainty.distribution,
        "sensitivity": row.sensitivity,
        "sensitivity_to": "logarithm" if source.relative else "value",
        "contribution": row.contribution,
        "share": row.contribution**2 / total**2 if total > 0 else 0.0,
        "degrees_of_freedom": _finite(source.uncertainty.degrees_of_freedom),
        "traceable_to": source.uncertainty.traceable_to,
        "common": source.common,
    }


def budgets(problem: JointProblem, fitted: Fitted, degrees_of_freedom: float) -> list[Budget]:
    """Return the budgets of all moduli of a fit, two for a material whose Poisson's ratio is known.

    In the order of the materials; none in reduced units and for single pairs. Source: JCGM 100
    (GUM) 5.1, on the joint fit's own linear form. Validation: the contributions' squares against
    the covariance, against ``uncertainties`` and against sampling in
    ``tests/analysis/test_budget.py``.
    """
    if fitted.failed:
        return []
    campaign = problem.campaign
    logs = dict(zip(problem.names, fitted.theta.tolist(), strict=True))
    found = sources(problem, fitted, degrees_of_freedom)
    return budgets_of(logs, fitted.covariance, found, campaign.spheres, campaign.surfaces)


def budgets_of(
    logs: Mapping[ParameterName, float],
    covariance: Array,
    found: Sequence[Source],
    spheres: Mapping[str, Sphere],
    surfaces: Mapping[str, Surface],
) -> list[Budget]:
    """Return the budgets of all moduli among some parameters, from the sources of their covariance.

    ``logs`` has the parameters in the covariance's order, ln E' of every material among them. The
    squares of the spreads of ``found`` add up to ``covariance``, shape (g, g).
    """
    made = []
    for j, (name, log) in enumerate(logs.items()):
        if not name.is_modulus:
            continue
        side, short = name.kind, name.owner
        made.append(_budget((name, PLANE), math.exp(log), found, (j, 1.0), {}))
        material = (spheres if side == "sphere" else surfaces)[short]
        young, ratio = material.youngs_modulus_pa, material.poissons_ratio
        if ratio is None:
            continue
        u = math.sqrt(float(covariance[j, j]))
        value, _ = young_from_plane_strain(log, u, young, ratio)
        share, direct = _youngs_form(young, ratio)
        own = {f"{side}s.{short}.{key}": x for key, x in direct.items()}
        made.append(_budget((name, YOUNG), value, found, (j, share), own))
    return made


def _youngs_form(young: Quantity | None, ratio: Quantity) -> tuple[float, dict[str, float]]:
    """Return how ln E follows ln E', and the material's own statements besides, by one u each.

    As `young_from_plane_strain` shares ln E' out between E and Poisson's ratio.
    """
    u_nu = nu_slope(ratio) * ratio.u
    if young is None:
        return 1.0, {"poissons_ratio": -u_nu}
    u_young = young.u / young.value
    total = u_young**2 + u_nu**2
    share = u_young**2 / total if total > 0 else 0.0
    return share, {"youngs_modulus_Pa": (1 - share) * u_young, "poissons_ratio": -share * u_nu}


def _budget(
    whose: tuple[ParameterName, str],
    value: float,
    found: Sequence[Source],
    form: tuple[int, float],
    direct: dict[str, float],
) -> Budget:
    j, share = form
    rows = [Row(s, share * s.spread[j] + direct.get(s.name, 0.0)) for s in found]
    total = sum(r.contribution**2 for r in rows)
    kept = [r for r in rows if r.contribution**2 > NEGLIGIBLE * total]
    kept.sort(key=lambda r: -r.contribution)
    return Budget(*whose, value, tuple(kept))


def budgets_json(problem: JointProblem, fitted: Fitted, degrees_of_freedom: float) -> Json | None:
    """Return all budgets as a fit's JSON has them, by material and modulus; None without moduli.

    As ``{"format", "moduli": {material: {measurand: budget}}}``. A name that is both a sphere's and
    a surface's is preceded by which it is, as under ``moduli``.
    """
    found = budgets(problem, fitted, degrees_of_freedom)
    return by_material(found, [b.name for b in found]) if found else None


def by_material(found: Sequence[Budget], names: Sequence[ParameterName]) -> Json:
    """Return budgets as JSON has them, see `budgets_json`.

    ``names`` are all materials that are listed beside them, also those without a budget.
    """
    moduli: Json = {}
    for one in found:
        moduli.setdefault(key_in_moduli(one.name, names), {})[one.measurand] = one.to_json()
    return {"format": FORMAT, "moduli": moduli}
