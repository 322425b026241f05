"""One environment for the templates of all reports, and the filters that write numbers."""

from __future__ import annotations

from functools import cache
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape

from analysis import written_numbers

MODULI = {"youngs_modulus_Pa": "E", "plane_strain_modulus_Pa": "E/(1-ν²)"}
"""Symbol of each modulus, by its key in the JSON; in the order of a report."""


def render(template: str, **values: Any) -> str:
    """Return a template of `templates/` filled with values: escaped in HTML, as is in Markdown."""
    return _environment().get_template(template).render(values)


@cache
def _environment() -> Environment:
    made = Environment(
        loader=PackageLoader("impactd.reports"),
        autoescape=select_autoescape(["html"], default=False),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    made.globals["MODULI"] = MODULI
    made.filters |= {
        "number": number,
        "percent": percent,
        "counted": written_numbers.counted,
        "p_value": p_value,
        "measured": measured,
        "gigapascals": gigapascals,
    }
    return made


def number(value: float | None, form: str, scale: float = 1.0) -> str:
    """Return a number times a scale; ``-`` for None."""
    return "-" if value is None else format(value * scale, form)


def percent(share: float, form: str = ".1f") -> str:
    """Return a share in per cent."""
    return f"{100 * share:{form}} %"


def p_value(value: float) -> str:
    """Return a p value; one too small for a float's own digits as a bound."""
    return f"p = {value:.2g}" if value > 1e-99 else "p < 1e-99"


def measured(quantity: Any, scale: float = 1.0) -> str:
    """Return a quantity of the JSON with its expanded uncertainty."""
    return written_numbers.measured(quantity, scale=scale, sign="±")


def gigapascals(quantity: Any) -> str:
    """Return a modulus in GPa with its expanded uncertainty, without the unit."""
    return measured(quantity, 1e-9)
