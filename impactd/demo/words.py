"""Moduli in words, the same on the terminal and on the page."""

from __future__ import annotations

from collections.abc import Iterable

from analysis.written_numbers import K_95, MOST_DECIMALS, decimals, measured
from impactd.aliases import Json
from impactd.demo.outcome import Estimate


def gigapascals(estimate: Estimate | None) -> str:
    """Return an estimate with its expanded uncertainty U (95 %), to two digits of it.

    Parameters
    ----------
    estimate : Estimate or None
        ``None``: withheld.

    Returns
    -------
    str
        E.g. ``2.35 ± 0.08``, in GPa.
    """
    if estimate is None:
        return "withheld"
    return measured(estimate.to_json(), scale=1e-9, sign="±")


def true_number(truth: float, estimates: Iterable[Json | None], scale: float = 1.0) -> str:
    """Return a true value to the digits of the sharpest estimate beside it.

    Parameters
    ----------
    truth : float
        In the unit of the estimates.
    estimates : iterable of dict or None
        Measurands with ``u``; ``None``: withheld.
    scale : float, optional
        Factor on all, for another unit. [1]

    Returns
    -------
    str
        To five significant digits where nothing has an uncertainty.
    """
    us = [K_95 * (one.get("u") or 0.0) * scale for one in estimates if one]
    digits = max((decimals(one) for one in us if one > 0.0), default=MOST_DECIMALS + 1)
    if digits > MOST_DECIMALS:
        return f"{truth * scale:.5g}"
    return f"{truth * scale:.{digits}f}"


def true_gigapascals(truth_pa: float, estimates: Iterable[Estimate | None]) -> str:
    """Return a true modulus in GPa, to the digits of the sharpest estimate beside it."""
    return true_number(truth_pa, (one.to_json() for one in estimates if one), 1e-9)


def inside(estimate: Estimate | None, truth_pa: float) -> str:
    """Return whether the 95 % interval holds the truth, in a word.

    Parameters
    ----------
    estimate : Estimate or None
        ``None``: withheld.
    truth_pa : float
        [Pa]

    Returns
    -------
    str
        ``yes``, ``no``, or ``-`` where nothing was stated.
    """
    if estimate is None:
        return "-"
    return "yes" if estimate.holds(truth_pa) else "no"


def off_by(estimate: Estimate | None, truth_pa: float) -> str:
    """Return how far an estimate is from the truth.

    Parameters
    ----------
    estimate : Estimate or None
        ``None``: withheld.
    truth_pa : float
        [Pa]

    Returns
    -------
    str
        In per cent; ``-`` where nothing was stated.
    """
    if estimate is None:
        return "-"
    percent = 100 * (estimate.value_pa / truth_pa - 1)
    return f"{percent:+.0f} %" if abs(percent) >= 10 else f"{percent:+.2f} %"
