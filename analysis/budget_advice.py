"""One sentence about a budget: what would reduce the uncertainty of a modulus most."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from analysis.budget import Budget, Row

ENOUGH = 3.0
"""A source whose contribution is a third of all others' together adds 5 % to them."""


def advice(budget: Budget) -> str:
    """Return in a sentence what would improve a modulus most, and the u that would be left."""
    worst = max(_measurable(budget.rows), key=_combined, default=[])
    if _combined(worst) < budget.part(common=False):
        return _more_shots(budget)
    whole, total, source = _combined(worst), budget.relative_u, worst[0].source
    share = _share(whole / total)
    if source.remedy:
        return f"{source.remedy}: the {source.label} is {share}."
    if source.value is None:
        return f"The {source.label} is {share}; nothing else would improve it as much."
    rest = math.sqrt(max(total**2 - whole**2, 0.0))
    # u at which the source would be a third of the rest; a tenth of today's where it is alone
    share_left = max(min(rest / ENOUGH / whole, 0.5), 0.1)
    said = source.uncertainty.u
    if source.relative:
        said = max(r.source.uncertainty.u / (r.source.value or 1.0) for r in worst)
        now, then = _percent(said), f"{100 * _rounded_down(said * share_left):.1g} %"
    else:
        unit = "" if source.unit == "1" else f" {source.unit}"
        now, then = f"{said:.2g}{unit}", f"{_rounded_down(said * share_left):.1g}{unit}"
    left = math.hypot(rest, whole * share_left)
    return (
        f"Measure the {_together(worst)} to {then} (now {now}): it is {share}, and u would "
        f"fall from {_percent(total)} to {_percent(left)}."
    )


def _more_shots(budget: Budget) -> str:
    """Return what reduces the part that is not common to all shots."""
    total, averaged = budget.relative_u, budget.part(common=False)
    worst = max((r for r in budget.rows if not r.source.common), key=lambda r: r.contribution)
    if worst.source.remedy:
        share = _share(worst.contribution / total)
        return f"{worst.source.remedy}: the {worst.source.label} is {share}."
    left = math.hypot(budget.part(common=True), averaged / 2)
    return (
        f"Drop four times as many shots: noise and scatter are {_share(averaged / total)}, and u "
        f"would fall from {_percent(total)} to {_percent(left)}."
    )


def _measurable(rows: tuple[Row, ...]) -> list[list[Row]]:
    """Return the common inputs by the measurement that determines them: all radii, all masses."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        if row.source.common:
            key, stated = row.source.name, row.source.stated
            if stated is not None and stated.quantity in ("radius", "mass"):
                key = stated.quantity
            found.setdefault(key, []).append(row)
    return list(found.values())


def _rounded_down(u: float) -> float:
    """Return an uncertainty rounded down to one significant digit."""
    unit = 10.0 ** math.floor(math.log10(u))
    return math.floor(u / unit + 1e-9) * unit


def _percent(relative: float) -> str:
    return f"{100 * relative:.2g} %"


def _share(part: float) -> str:
    """Return in words which share of the variance a part of u is."""
    return f"{100 * part**2:.0f} % of its variance"


def _combined(rows: list[Row]) -> float:
    return math.sqrt(sum(r.contribution**2 for r in rows))


def _together(rows: list[Row]) -> str:
    """Return what several rows of one kind are called."""
    label = rows[0].source.label.removeprefix("stated ")
    if len({row.source.name for row in rows}) == 1:  # one number may act in two ways
        return label
    stated = [row.source.stated for row in rows if row.source.stated is not None]
    *most, last = (one.owner for one in stated)
    return f"{stated[0].quantity} of the spheres {', '.join(most)} and {last}"
