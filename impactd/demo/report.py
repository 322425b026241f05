"""report.html: the demo's result on one page, complete but for the diagnosis beside it."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from impactd import __version__
from impactd.aliases import Json
from impactd.demo import words
from impactd.demo.outcome import CLOSED, Outcome
from impactd.demo.sealed_effects import compared_effects
from impactd.diagnosis.interactive import error_chart, signal_chart
from impactd.diagnosis.repair import MEAN_WAVEFORM
from impactd.diagnosis.unit import unit_of
from impactd.reports.charts import with_library
from impactd.reports.templating import render


def write_report(file: Path, outcome: Outcome, pictures: Mapping[str, Path]) -> None:
    """Write the page.

    Parameters
    ----------
    file : Path
        Where to; ``diagnosis.html`` is expected beside it.
    pictures : mapping
        PNG files by name: ``trace``, ``moduli``.
    """
    page = render(
        "demo.html",
        outcome=outcome,
        effects=compared_effects(outcome.truth, outcome.diagnosis["effects"]),
        sensor=_sensor(outcome),
        charts=_charts(outcome),
        pictures={name: _inline(picture) for name, picture in pictures.items()},
        words=words,
        software=f"impactd {__version__}",
        MEAN_WAVEFORM=MEAN_WAVEFORM,
    )
    file.write_text(with_library(page), encoding="utf-8")


def _charts(outcome: Outcome) -> dict[str, Json]:
    """Return the held-out error of every model, and the shots with the last two."""
    found = outcome.diagnosis
    unit = unit_of(found)
    errors = {rung.name: rung.heldout_rms_v for rung in outcome.rungs}
    errors[MEAN_WAVEFORM] = outcome.mean_waveform_rms_v
    held = {"held-out drops": list(errors.values())}
    charts = {
        "signal": signal_chart(found, unit),
        "error": error_chart(list(errors), held, found["noise_rms_V"], unit),
    }
    return {name: chart for name, chart in charts.items() if chart}


@dataclass(frozen=True)
class _Sensor:
    """The load cell's numbers: as calibrated, as found from all drops, and the truth.

    Attributes
    ----------
    columns : list of str
        Without a calibration that gave no result.
    rows : list of tuple
        Name, a measurand or None for each column, truth, whether the last one holds it.
    failed : str
        Why the calibration gave no result; empty where it did.
    """

    columns: list[str]
    rows: list[tuple[str, list[Any], float, str]]
    failed: str


def _sensor(outcome: Outcome) -> _Sensor:
    result = outcome.calibration.get("result")
    columns, failed = {}, ""
    if result:
        calibrated = {**result["parameters"], **result["identifiable"]}
        columns[f"calibration under {CLOSED}"] = calibrated
    else:
        failed = (outcome.calibration.get("problem") or {}).get("detail") or "no reason is given."
    columns |= {
        f"all drops, {rung.name}": rung.block.get("parameters", {})
        for rung in outcome.rungs
        if rung.key in ("kv2", "after") and rung.block.get("parameters")
    }
    rows = []
    for name, true_value in _true_sensor(outcome.truth.get("sensor", {})).items():
        stated = [_of_sensor(found, name) for found in columns.values()]
        if any(found and found.get("value") is not None for found in stated):
            rows.append((name, stated, true_value, _holds(stated[-1], true_value)))
    return _Sensor(list(columns), rows, failed)


def _of_sensor(parameters: dict[str, Any], name: str) -> Any:
    """Return a parameter of the cell; units in names differ only in their capitals."""
    plain = {key.lower(): found for key, found in parameters.items()}
    return plain.get(f"sensor.{name.lower()}") or plain.get(name.lower())


def _holds(found: Any, true_value: float) -> str:
    """Return whether an interval holds the truth; an open end holds everything beyond."""
    low, high = (found or {}).get("interval95") or (None, None)
    if low is None and high is None:
        return "-"
    inside = (low is None or low <= true_value) and (high is None or true_value <= high)
    return "yes" if inside else "no"


def _true_sensor(sealed: dict[str, Any]) -> dict[str, float]:
    """Return the true cell, the combinations that a trace can tell first."""
    plain = {key: value for key, value in sealed.items() if isinstance(value, float)}
    if "crystal_mass_kg" not in plain:
        return plain
    mass, stiffness = plain["crystal_mass_kg"], plain["crystal_stiffness_N_per_m"]
    damping, compliance = plain["crystal_damping_N_s_per_m"], plain["compliance_m_per_V"]
    return {
        "gain_N_per_V": stiffness * compliance,
        "natural_frequency_Hz": math.sqrt(stiffness / mass) / (2 * math.pi),
        "damping_ratio": damping / (2 * math.sqrt(stiffness * mass)),
    } | plain


def _inline(picture: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(picture.read_bytes()).decode()
