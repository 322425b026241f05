"""report.html: the demo's result on one page, complete but for the diagnosis beside it."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from impactd import __version__
from impactd.demo.judgement import truth_line
from impactd.demo.outcome import CLOSED, Outcome, Row
from impactd.demo.page import PAGE
from impactd.demo.words import gigapascals, inside, off_by, true_gigapascals
from impactd.diagnosis.repair import MEAN_WAVEFORM
from impactd.reports.numbers import measured

_KNOWN = ' <span class="soft">(known before)</span>'


def write_report(file: Path, outcome: Outcome, pictures: Mapping[str, Path]) -> None:
    """Write the page.

    Parameters
    ----------
    file : Path
        Where to; ``diagnosis.html`` is expected beside it.
    pictures : mapping
        PNG files by name: ``trace``, ``moduli``.
    """
    effects = outcome.truth.get("effects") or []
    sealed = [truth_line(effect) for effect in effects] or ["Nothing: the base model is complete."]
    judgement, found = outcome.judgement, outcome.diagnosis
    page = PAGE.substitute(
        drops=found["campaign"]["shots"],
        seed=outcome.seed,
        verdict=html.escape(found["verdict"].upper()),
        sentence=html.escape(found["sentence"]),
        word=html.escape(judgement.word),
        mark="right" if judgement.right else "wrong",
        judgement=html.escape(judgement.sentence),
        ladder=_ladder(outcome),
        noise=f"{1e3 * found['noise_rms_V']:.3g}",
        seen="".join(
            f"<li>{html.escape(line)}</li>" for line in found["residual"]["before"]["said"]
        ),
        active=_active(outcome),
        pairs=_table("pair", outcome.pairs, outcome),
        materials=_table("material", outcome.materials, outcome),
        moduli_png=_inline(pictures["moduli"]),
        trace_png=_inline(pictures["trace"]),
        calibration=outcome.calibration["number"],
        calibration_drops=len(outcome.calibration["drops"]),
        sensor=_sensor(outcome),
        sealed="".join(f"<li>{html.escape(line)}</li>" for line in sealed),
        software=html.escape(f"impactd {__version__}"),
    )
    file.write_text(page, encoding="utf-8")


def _ladder(outcome: Outcome) -> str:
    truth_pa = outcome.specimen_truth_pa
    rows = []
    for rung in outcome.rungs:
        held, found = rung.heldout_rms_v, rung.specimen
        holds, stated = outcome.held(rung.key)
        cells = (
            html.escape(rung.name),
            "-" if held is None else f"{1e3 * held:.4g}",
            gigapascals(found),
            f"{truth_pa / 1e9:.3f}",
            off_by(found, truth_pa),
            inside(found, truth_pa),
            f"{holds} of {stated}" if stated else "-",
        )
        rows.append(
            f'<tr class="{rung.key}">' + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>"
        )
    mean = outcome.mean_waveform_rms_v
    if mean is not None:
        empty = "<td>-</td>" * 5
        rows.append(f"<tr><td>{MEAN_WAVEFORM}</td><td>{1e3 * mean:.4g}</td>{empty}</tr>")
    head = (
        "<tr><th>model</th><th>error on held-out drops / mV</th>"
        "<th>specimen E/(1-ν²) ± U (95 %) / GPa</th><th>truth / GPa</th><th>off by</th>"
        "<th>in its 95 %?</th><th>pairs whose 95 % hold the truth</th></tr>"
    )
    return f"<table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table>"


def _active(outcome: Outcome) -> str:
    if outcome.model is None:
        return "No model was made active: later fits still use the closed KV."
    return (
        f"<code>{html.escape(outcome.model)}</code> was made the active model: later fits use it, "
        "earlier results keep theirs."
    )


def _table(what: str, rows: list[Row], outcome: Outcome) -> str:
    body = []
    last = outcome.last.key
    for row in rows:
        cells = [
            html.escape(row.name) + (_KNOWN if row.known else ""),
            str(row.shots),
            *(gigapascals(row.estimates[rung.key]) for rung in outcome.rungs),
            true_gigapascals(row),
            inside(row.estimates[last], row.truth_pa),
        ]
        body.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    rungs = "".join(
        f'<th class="{rung.key}">{html.escape(rung.name)}</th>' for rung in outcome.rungs
    )
    return (
        f"<table><thead><tr><th>{what}</th><th>drops</th>{rungs}"
        f'<th>truth</th><th class="{last}">inside its 95 %?</th></tr>'
        f"</thead><tbody>{''.join(body)}</tbody></table>"
    )


def _sensor(outcome: Outcome) -> str:
    """Return the cell's numbers: as calibrated, as found from all drops, and the truth."""
    result = outcome.calibration.get("result") or {}
    columns = {
        f"calibration under {CLOSED}": {
            **result.get("parameters", {}),
            **result.get("identifiable", {}),
        }
    }
    columns |= {
        f"all drops, {rung.name}": rung.block.get("parameters", {})
        for rung in outcome.rungs
        if rung.key in ("kv2", "after") and rung.block.get("parameters")
    }
    truth = _true_sensor(outcome.truth.get("sensor", {}))
    rows = []
    for name, true_value in truth.items():
        stated = [_of_sensor(found, name) for found in columns.values()]
        cells = [measured(found, sign="±") for found in stated]
        if any(cell != "-" for cell in cells):
            told = "".join(
                f"<td>{cell}</td>"
                for cell in (*cells, f"{true_value:.5g}", _holds(stated[-1], true_value))
            )
            rows.append(f"<tr><td>{html.escape(name)}</td>{told}</tr>")
    head = "".join(
        f"<th>{html.escape(name)}</th>" for name in ("number", *columns, "truth", "in its 95 %?")
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


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
