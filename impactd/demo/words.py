"""Moduli in words, the same on the terminal and on the page."""

from __future__ import annotations

from analysis.written_numbers import K_95, decimals, measured
from impactd.demo.outcome import Estimate, Row


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


def true_gigapascals(row: Row) -> str:
    """Return a row's truth, to the digits of its sharpest estimate.

    Parameters
    ----------
    row : Row
        Pair or material.

    Returns
    -------
    str
        In GPa.
    """
    stated = [one for one in row.estimates.values() if one is not None]
    digits = max((decimals(K_95 * one.u_pa / 1e9) for one in stated), default=3)
    return f"{row.truth_pa / 1e9:.{digits}f}"


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
