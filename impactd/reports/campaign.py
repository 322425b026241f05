"""All results of a period on one page: moduli, network, pairs, control charts and budgets."""

from __future__ import annotations

from collections.abc import Sequence

from impactd.aliases import Json
from impactd.reports.templating import render

_WIDE, _HIGH, _EDGE = 600.0, 150.0, 8.0
"""A control chart's drawing. [px]"""
_FEWEST = 3
"""Shots that are worth a chart: two show no scatter beside a trend."""


def campaign_page(found: Json, charts: Sequence[Json], budget: Json) -> str:
    """Return the page.

    Parameters
    ----------
    found : dict
        The answer of ``GET /v1/results``.
    charts : sequence of dict
        Answers of ``GET /v1/results/chart``, one for each pair.
    budget : dict
        ``impactd-budget/1`` of the same period.
    """
    drawn = [(chart, _drawing(chart)) for chart in charts if len(chart["numbers"]) >= _FEWEST]
    return render("campaign.html", found=found, charts=drawn, budget=budget)


def _drawing(chart: Json) -> Json:
    """Return the drawing: ``points`` as (x, y, shot, time, E*, outside), and ``lines``."""
    values, control = chart["reduced_modulus_Pa"], chart["control"] or {}
    limits = {key: control[f"{key}_Pa"] for key in ("lower", "centre", "upper") if control}
    shown = [*values, *limits.values()]
    low, high = min(shown), max(shown)
    middle, per_px = (low + high) / 2, (high - low) / (_HIGH - 2 * _EDGE) or 1.0
    step = (_WIDE - 2 * _EDGE) / max(len(values) - 1, 1)

    def height(value: float) -> float:
        """Return the place of a modulus. [px from the top]"""
        return float(_HIGH / 2 - (value - middle) / per_px)

    points = [
        (
            _EDGE + place * step,
            height(value),
            shot,
            at[:16].replace("T", " "),
            value,
            bool(limits) and not limits["lower"] <= value <= limits["upper"],
        )
        for place, (value, shot, at) in enumerate(
            zip(values, chart["numbers"], chart["started_utc"], strict=True)
        )
    ]
    lines = [(name, height(value)) for name, value in limits.items()]
    return {"wide": _WIDE, "high": _HIGH, "low": low, "top": high, "points": points, "lines": lines}
