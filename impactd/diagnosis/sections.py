"""The words and tables of the page, one function per section."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from typing import Any

from impactd.console.tables import measured
from impactd.effect_list import effect_list

Json = dict[str, Any]

FAMILIES = {
    "response": "a linear chain: delays, slow decays, resonances",
    "static": "a nonlinearity of the signal",
    "dynamic": "a nonlinearity of the signal's slope",
    "contact": "a contact force over depth and rate",
    "loss": "a force on the sphere alone",
    "cell": "the cell's own numbers",
    "speed": "the impact speed that a height promises",
    "locked": "anything at a fixed time after touch-down",
}
_QUALITY = (
    ("rms_V", "rms residual / mV", 1e3, ".4g"),
    ("heldout_rms_V", "held out / mV", 1e3, ".4g"),
    ("nrmse", "NRMSE / %", 1e2, ".3g"),
    ("r2", "R²", 1.0, ".6f"),
    ("chi2_per_dof", "χ² per degree of freedom", 1.0, ".4g"),
)


def campaign(document: Json) -> str:
    """Return what the campaign consists of."""
    seen = document["campaign"]
    heights = ", ".join(f"{h * 1e3:.1f}" for h in seen["drop_heights_m"])
    said = f"{seen['shots']} shots of {', '.join(seen['spheres'])} on {', '.join(seen['surfaces'])}"
    return f"{said}, from {heights} mm" if heights else said


def bullets(lines: list[str]) -> str:
    """Return lines as a list."""
    items = "".join(f"<li>{html.escape(line)}</li>" for line in lines)
    return f"<ul>{items}</ul>" if items else ""


def found(document: Json) -> str:
    """Return what each named effect is, with its numbers."""
    known = {one["id"]: one for one in effect_list()}
    parts = []
    for effect in document["effects"]:
        listed = known.get(effect["id"], {})
        rows = [
            (html.escape(name), _measured(value), html.escape(value["unit"]))
            for name, value in effect["parameters"].items()
        ]
        parts.append(
            f"<h3><code>{html.escape(effect['id'])}</code>: {html.escape(effect['title'])}</h3>"
            f'<p class="soft">Lives in: {html.escape(effect["slot"])}. Shows as: '
            f"{html.escape(listed.get('tell_tale', ''))}. Source: "
            f"{html.escape(listed.get('source', ''))}.</p>"
            + (table(("number", "value ± u", "unit"), rows) if rows else "")
        )
        if effect["confusable_with"]:
            names = ", ".join(effect["confusable_with"])
            parts.append(f"<p>These data cannot tell it from: {html.escape(names)}.</p>")
    return "".join(parts)


def quality(document: Json) -> str:
    """Return the figures of both models beside the noise."""
    rows = []
    for key, label, factor, form in _QUALITY:
        cells = [
            "-" if value is None else format(value * factor, form)
            for value in (document["before"].get(key), document["after"].get(key))
        ]
        noise = format(document["noise_rms_V"] * 1e3, ".4g") if key.endswith("rms_V") else ""
        if key == "rms_V":
            noise = format(document["noise_rms_V"] * 1e3, ".4g")
        rows.append((label, *cells, noise))
    names = [html.escape(document[side]["model"]) for side in ("before", "after")]
    note = ""
    if document["after"].get("first_order"):
        note = '<p class="soft">The closure\'s figures are first-order estimates.</p>'
    return table(("", f"before: {names[0]}", f"after: {names[1]}", "noise"), rows) + note


def slots(document: Json) -> str:
    """Return how much of the residual anything in each slot could explain on held-out shots."""
    if not document["slots"]:
        return "<p>There is nothing to locate.</p>"
    rows = []
    for slot, seen in sorted(
        document["slots"].items(), key=lambda item: -item[1]["share_of_residual"]
    ):
        share = min(seen["share_of_residual"], 1.0)
        bar = f'<span class="bar" style="width:{12 * share:.2f}rem"></span> {share:.2%}'
        rows.append((html.escape(slot), f'<td class="words">{bar}</td>'))
    said = (
        f"<p>Most likely the <b>{html.escape(document['slot'])}</b> slot.</p>"
        if document["slot"]
        else ""
    )
    return (
        f"{said}<p class='soft'>Upper bounds: what the most flexible closure of each slot explains "
        "of the residual on shots it was not fitted to. A named effect has to do as well.</p>"
        + table(("slot", "share of the residual's energy"), rows)
    )


def trail(document: Json) -> str:
    """Return every turn of the loop with its candidates and why they were not taken."""
    parts = []
    for place, turn in enumerate(document["trail"]):
        lines = document["candidates"] if place == 0 else turn["candidates"]
        verdict = "structure" if turn["structured"] else "noise"
        parts.append(
            f"<h3>{place + 1}. {html.escape(turn['model'])}: its residual is {verdict} "
            f"({_p(turn['p_value'])})</h3>"
        )
        if lines:
            parts.append(f'<div class="wide">{_candidates(lines)}</div>')
    return "".join(parts)


def _candidates(lines: list[Json]) -> str:
    body = []
    for line in lines:
        held, gain = line["heldout_rms_V"], line["delta_log_likelihood"]
        mark = " class=taken" if line["why_not"] is None else ""
        body.append(
            f"<tr{mark}><td><code>{html.escape(line['form'])}</code></td>"
            f"<td>{html.escape(line['slot'])}</td>"
            f"<td>{'-' if held is None else f'{held * 1e3:.4g}'}</td>"
            f"<td>{'-' if gain is None else f'{gain:.4g}'}</td>"
            f'<td class="words">{html.escape(line["why_not"] or "taken")}</td></tr>'
        )
    head = (
        "<tr><th>candidate</th><th>slot</th><th>held out / mV</th><th>Δ log likelihood</th>"
        '<th class="words">why not</th></tr>'
    )
    return f"<table><thead>{head}</thead><tbody>{''.join(body)}</tbody></table>"


def closure(document: Json) -> str:
    """Return the learned closure, where no name was earned."""
    learned = document["closure"]
    if learned is None:
        return ""
    largest = sorted(learned["coefficients"].items(), key=lambda item: -abs(item[1]))[:12]
    rows = [(html.escape(name), f"{value:.4g}") for name, value in largest]
    what = FAMILIES.get(learned["family"], learned["family"])
    return (
        "<h2>The learned closure</h2>"
        f"<p>What no name explains is best taken up by <b>{html.escape(what)}</b>, with "
        f"{learned['numbers']} numbers, owned by {html.escape(learned['scope'])}. Its largest "
        "coefficients:</p>" + table(("column", "coefficient"), rows)
    )


def moduli(document: Json) -> str:
    """Return both models' moduli as a table."""
    before, after = document["before"]["moduli"], document["after"]["moduli"]
    if not before:
        return "<p>These recordings have no moduli: they are in reduced units.</p>"
    rows = []
    for name, old in before.items():
        new = after.get(name, {})
        rows.append(
            (
                html.escape(name),
                html.escape(str(new.get("status", old["status"]))),
                _gigapascals(old, "youngs_modulus_Pa"),
                _gigapascals(new, "youngs_modulus_Pa"),
                _change(old, new),
                f'<td class="words">{html.escape(new.get("reason") or "")}</td>',
            )
        )
    head = ("material", "status", "E before / GPa", "E after / GPa", "change", "")
    return f'<div class="wide">{table(head, rows)}</div>'


def _measured(quantity: Json | None, *, scale: float = 1.0) -> str:
    return html.escape(measured(quantity, scale=scale)).replace("+-", "±")


def _p(value: float) -> str:
    return f"p = {value:.2g}" if value > 1e-99 else "p < 1e-99"


def _gigapascals(entry: Json, key: str) -> str:
    return _measured(entry.get(key), scale=1e-9)


def _change(old: Json, new: Json) -> str:
    a, b = old.get("plane_strain_modulus_Pa"), new.get("plane_strain_modulus_Pa")
    return f"{100 * (b['value'] / a['value'] - 1):+.2f} %" if a and b else "-"


def remains(document: Json) -> str:
    """Return what the last model leaves over."""
    left = document["remaining"]
    if not left["structured"]:
        said = f"<p>Noise: the omnibus test finds no structure ({_p(left['p_value'])}).</p>"
    else:
        family = left.get("strongest", {}).get("family", "")
        what = FAMILIES.get(family, family)
        said = (
            f"<p>Structure ({_p(left['p_value'])}); what takes up most of it is "
            f"{html.escape(what)}.</p>"
        )
    after = document["residual"]["after"]
    return said + bullets(after["said"] if after else [])


def next_drop(document: Json) -> str:
    """Return which drop would tell most."""
    wanted = document["next_drop"]
    if wanted is None:
        return "Nothing that was found asks for another drop."
    if isinstance(wanted, dict) and wanted.get("sentence"):
        return html.escape(str(wanted["sentence"]))
    return html.escape(json.dumps(wanted, ensure_ascii=False))


def circumstances(document: Json) -> str:
    """Return what was assumed and what was refused."""
    lines = list(document["assumptions"])
    lines += [
        f"Rejected: {one['name']} ({one['path']}): {one['reason']}" for one in document["rejected"]
    ]
    lines.append(f"Noise before the trigger: {document['noise_rms_V'] * 1e3:.4g} mV rms.")
    return bullets(lines)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table; a cell that is already a ``<td>`` stays as it is.

    Parameters
    ----------
    head : sequence of str
        One per column.
    rows : sequence of sequences
        Cells, escaped by the caller.

    Returns
    -------
    str
        HTML.
    """
    top = "".join(f"<th>{cell}</th>" for cell in head)
    body = "".join(
        f"<tr>{''.join(c if c.startswith('<td') else f'<td>{c}</td>' for c in row)}</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"
