"""The charts of a diagnosis that answer the mouse.

A chart is a ``layout`` as plotly takes it, ``x`` (a list of axes), and ``choices``, of which one is
drawn: a ``name`` and ``traces``, whose ``x`` is a place in the list of axes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from analysis.plots.span import span_us
from analysis.plots.style import height_words, named_pair
from impactd.aliases import Json
from impactd.diagnosis.figures import AFTER, BEFORE, INK, NOISE
from impactd.diagnosis.repair import MEAN_WAVEFORM, is_repaired
from impactd.diagnosis.unit import Unit

LOG_FROM = 10.0
"""Ratio of the largest error to the noise from which their axis is logarithmic. A choice: a
tenth of an axis is the least that an eye reads."""


def charts(document: Json, unit: Unit) -> dict[str, Json]:
    """Return the charts of a diagnosis by name; without those that it has no numbers for."""
    sides = ("before", "after") if is_repaired(document) else ("before",)
    models = {f"{side}: {document[side]['model']}": document[side] for side in sides}
    if document.get("mean_waveform"):
        models[MEAN_WAVEFORM] = document["mean_waveform"]
    errors = {
        label: [one.get(key) for one in models.values()]
        for key, label in (("rms_V", "all shots"), ("heldout_rms_V", "held-out shots"))
    }
    drawn = {
        "signal": signal_chart(document, unit),
        "error": error_chart(list(models), errors, document["noise_rms_V"], unit),
    }
    return {name: chart for name, chart in drawn.items() if chart}


def signal_chart(document: Json, unit: Unit) -> Json | None:
    """Return signal, model and residual of a pair and height that is chosen, before and after.

    None where the diagnosis has no residuals of pairs.
    """
    residual = document["residual"]
    stacks = {
        f"{side}: {document[side]['model']}": seen["stacks"]
        for side in ("before", "after")
        if (seen := residual[side]) and seen.get("stacks")
    }
    if not stacks:
        return None
    first, noise = next(iter(stacks.values())), document["noise_rms_V"] * unit.factor
    curves = first["by_pair_and_height"]
    layout = {
        **_LAYOUT,
        "height": 520,
        "xaxis": {"title": {"text": "time after touch-down / µs"}, "range": span_us(first)},
        "yaxis": {"title": {"text": f"residual / {unit.label}"}, "domain": [0, 0.4]},
        "yaxis2": {"title": {"text": f"signal / {unit.label}"}, "domain": [0.46, 1]},
        "shapes": [{**_BAND, "y0": -noise, "y1": noise}],
    }
    choices = []
    for place, curve in enumerate(curves):
        where = f"{named_pair(curve['pair'])} {height_words(curve['drop_height_m'])}".strip()
        traces = []
        for axis, (model, colour) in enumerate(zip(stacks, (BEFORE, AFTER), strict=False)):
            own = stacks[model]["by_pair_and_height"][place]
            traces += _pair_traces(model, own, axis, colour, unit)
        choices.append({"name": f"{where}: mean of {curve['shots']}", "traces": traces})
    return {
        "layout": layout,
        "x": [one["time_us"] for one in stacks.values()],
        "choices": choices,
    }


def _pair_traces(model: str, curve: Json, axis: int, colour: str, unit: Unit) -> list[Json]:
    """Return a model's residual, and the model over the signal where the document has it."""
    left = curve["mean"]
    found = [_line(f"residual {model}", axis, _shown(left, unit), colour)]
    if "signal" in curve:
        signal = curve["signal"]
        fitted = [None if s is None else s - r for s, r in zip(signal, left, strict=True)]
        recorded = {**_line("signal", axis, _shown(signal, unit), INK), "yaxis": "y2"}
        found += [{**_line(model, axis, _shown(fitted, unit), colour), "yaxis": "y2"}]
        found += [{**recorded, "mode": "markers", "marker": {"size": 3, "color": INK}}]
    return found


def error_chart(
    models: Sequence[str],
    errors: Mapping[str, Sequence[float | None]],
    noise_rms: float,
    unit: Unit,
) -> Json | None:
    """Return the errors of models beside the noise; None where none is known.

    Parameters
    ----------
    errors : mapping of str to list
        Of each kind of error one number for each model. [as recorded]
    noise_rms : float
        Of one sample. [as recorded]
    """
    known = [value for values in errors.values() for value in values if value is not None]
    if not known:
        return None
    log = noise_rms > 0.0 and max(known) > LOG_FROM * noise_rms
    layout: Json = {
        **_LAYOUT,
        "height": 300,
        "xaxis": {"type": "category", "range": [-0.5, len(models) - 0.5]},
        "yaxis": {"title": {"text": f"error / {unit.label}"}, "type": "log" if log else "linear"},
    }
    layout["yaxis"] |= {"dtick": "D2"} if log else {"rangemode": "tozero"}
    traces = [
        {
            **_line(label, 0, _shown(values, unit), colour),
            "mode": "markers",
            "marker": {"size": 11, "symbol": symbol, "color": colour},
        }
        for (label, values), colour, symbol in zip(
            errors.items(), (BEFORE, AFTER), ("circle", "diamond"), strict=False
        )
    ]
    traces.append(_line("noise", 0, _shown([noise_rms] * len(models), unit), NOISE))
    return {"layout": layout, "x": [list(models)], "choices": [{"name": "", "traces": traces}]}


_LAYOUT = {
    "margin": {"l": 70, "r": 10, "t": 10, "b": 50},
    "font": {"family": "system-ui, sans-serif", "size": 13, "color": INK},
    "legend": {"orientation": "h", "x": 0, "y": 1.02, "yanchor": "bottom"},
    "hovermode": "closest",
}
_BAND = {
    "type": "rect",
    "xref": "paper",
    "x0": 0,
    "x1": 1,
    "layer": "below",
    "line": {"width": 0},
    "fillcolor": NOISE,
    "opacity": 0.3,
}


def _line(name: str, axis: int, y: Sequence[float | None], colour: str) -> Json:
    return {
        "name": name,
        "x": axis,
        "y": y,
        "mode": "lines",
        "line": {"color": colour, "width": 1.5},
        "hovertemplate": "%{y:.4~r}<extra>%{fullData.name}</extra>",
    }


def _shown(values: Sequence[float | None], unit: Unit) -> list[float | None]:
    """Return numbers in the unit of the page, to the four digits that the JSON has of curves."""
    return [None if v is None else float(f"{unit.factor * v:.4g}") for v in values]
