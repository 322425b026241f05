"""Every figure has units on its axes and is read without colour."""

from __future__ import annotations

import colorsys
import dataclasses
from collections.abc import Callable
from typing import Any

import matplotlib.colors
import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from analysis import (
    AnalysisError,
    Campaign,
    fit_campaign,
    literature_of,
    plot_calibrations,
    plot_confusion,
    plot_moduli,
    plot_residuals,
    plot_shot,
    plot_traces,
)
from analysis.plots.budget import plot_budget
from analysis.plots.paper_figures import figure_2, figure_3, figure_4
from analysis.plots.style import named_pair

COMBINATIONS = ("natural_frequency_Hz", "damping_ratio", "gain_N_per_V")


@pytest.fixture(scope="module")
def fits(made: tuple[Any, Campaign]) -> tuple[Any, Any]:
    """HSD and KV fitted to six shots."""
    campaign = dataclasses.replace(made[1], shots=made[1].shots[:6])
    return fit_campaign(campaign, "hsd"), fit_campaign(campaign, "kv")


def series(count: int, days: int) -> list[dict[str, Any]]:
    """Return calibrations some days apart, one of which drifted."""
    rng = np.random.default_rng(4)
    found = []
    for i in range(count):
        moved = {k: {"u": 3e-4, "in_u": 4.0 if i == 2 else 0.5} for k in COMBINATIONS}
        values = {
            k: {"value": v * (1 + 1e-3 * rng.normal()), "u": 1e-3 * v}
            for k, v in zip(COMBINATIONS, (17250.0, 0.073, 2.33), strict=True)
        }
        found.append(
            {
                "number": i + 1,
                "finished_utc": f"2026-01-{1 + i * days:02}T02:00:00Z",
                "identifiable": values,
                "since_first": {"combinations": moved} if i else None,
                "since_previous": {"combinations": moved} if i else None,
            }
        )
    return found


MATRIX = {
    "rows": ["none", "echo"],
    "columns": ["adequate", "echo"],
    "counts": {"all": [[5, 0], [1, 3]], "detectable": [[0, 0], [0, 0]]},
}


def _a_budget(fit: Any) -> dict[str, Any]:
    """Return the budget of one modulus of a fit."""
    of_materials: list[dict[str, Any]] = list(fit.budget()["moduli"].values())
    found: dict[str, Any] = of_materials[0]["plane_strain_modulus_Pa"]
    return found


DRAWN: dict[str, Callable[[Any, Any], Figure]] = {
    "shot": lambda hsd, kv: plot_shot(hsd, kv, shot=2),
    "residuals": lambda hsd, _: plot_residuals(hsd),
    "traces": lambda _, kv: plot_traces(kv),
    "moduli": lambda _, kv: plot_moduli(kv.to_json(), literature_of(kv.problem.campaign)),
    "budget": lambda _, kv: plot_budget("E'", _a_budget(kv)),
    "calibrations": lambda *_: plot_calibrations(series(5, 3)),
    "one afternoon": lambda *_: plot_calibrations(series(3, 0)),
    "confusion": lambda *_: plot_confusion(MATRIX, "all"),
    "figure 2": lambda *_: figure_2(),
    "figure 3": lambda *_: figure_3(),
    "figure 4": lambda *_: figure_4(),
}
COUNTED = {"number of the calibration", "said", "acted", "time (UTC)", ""}
"""Labels of what has no unit."""


@pytest.mark.parametrize("name", DRAWN)
def test_every_axis_has_a_unit(name: str, fits: tuple[Any, Any]) -> None:
    """`quantity / unit` on each labelled axis, and at least one label per direction."""
    figure = DRAWN[name](*fits)
    labels = [axes.get_xlabel() for axes in figure.axes] + [a.get_ylabel() for a in figure.axes]
    assert any(labels)
    for label in labels:
        assert label in COUNTED or " / " in label.replace("\n", " "), label


@pytest.mark.parametrize("name", DRAWN)
def test_lines_of_one_panel_differ_without_colour(name: str, fits: tuple[Any, Any]) -> None:
    """Labelled lines of a panel have another style, marker or width, or a clearly other grey."""
    for axes in DRAWN[name](*fits).axes:
        looks = [_look(line) for line in _named(axes)]
        for i, one in enumerate(looks):
            for other in looks[:i]:
                assert one[:3] != other[:3] or abs(one[3] - other[3]) > 0.15, (name, one, other)


def _named(axes: Axes) -> list[Any]:
    return [line for line in axes.lines if not str(line.get_label()).startswith("_")]


def _look(line: Any) -> tuple[str, str, float, float]:
    grey = colorsys.rgb_to_yiq(*matplotlib.colors.to_rgb(line.get_color()))[0]
    return str(line._dash_pattern), str(line.get_marker()), line.get_linewidth(), grey


def test_a_shot_is_named_by_place_or_name(fits: tuple[Any, Any]) -> None:
    """Both ways lead to the same shot; an unknown one is told with those that are there."""
    name = fits[1].shots[2].item.shot.name
    titles = [plot_shot(*fits, shot=s).axes[0].get_title(loc="left") for s in (2, name)]
    assert titles[0] == titles[1]
    assert titles[0].startswith(name)
    with pytest.raises(AnalysisError, match="The fit has 6 shots"):
        plot_shot(*fits, shot="no such")
    with pytest.raises(AnalysisError, match="No fit was given"):
        plot_shot()


def test_all_models_are_drawn_on_one_clock(fits: tuple[Any, Any]) -> None:
    """Record less prediction is the residual that is drawn below, although touch-downs differ."""
    figure = plot_shot(*fits, shot=2)
    upper, first = figure.axes[0], figure.axes[1]
    record, hsd = (line.get_xydata() for line in _named(upper)[:2])
    drawn = first.lines[0].get_xydata()
    x = np.linspace(20.0, 100.0, 50)
    left = np.interp(x, *record.T) - np.interp(x, *hsd.T)
    np.testing.assert_allclose(1e3 * left, np.interp(x, *drawn.T), atol=0.02 * np.ptp(drawn[:, 1]))


def test_nothing_to_draw_is_said() -> None:
    """An empty matrix, no modulus, no calibration: a sentence and no empty axes."""
    with pytest.raises(AnalysisError, match="no trial"):
        plot_confusion(MATRIX, "detectable")
    with pytest.raises(AnalysisError, match="'some'"):
        plot_confusion(MATRIX, "some")
    with pytest.raises(AnalysisError, match="no modulus"):
        plot_moduli({"moduli": {"specimen": {"youngs_modulus_Pa": None}}})
    with pytest.raises(AnalysisError, match="impactd calibrate"):
        plot_calibrations([])


def test_a_pair_with_a_slash_in_a_name_keeps_its_name() -> None:
    """Nobody can tell where the sphere's name ends."""
    assert named_pair("acetal/specimen") == "acetal on specimen"
    assert named_pair("POM 1/4in/PEEK") == "POM 1/4in/PEEK"
