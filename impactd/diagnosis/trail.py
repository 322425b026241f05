"""How the loop went, as the page tells it: slots, candidates, closure, what remains."""

from __future__ import annotations

import html

from analysis.diagnosis.document.wording import FAMILIES
from impactd.aliases import Json
from impactd.diagnosis.markup import bullets, p_words, table
from impactd.diagnosis.unit import Unit, unit_of

OWNERS = {"rig": "one set for all shots", "shot": "numbers of its own in every shot"}
_OF_SHOTS = ("column", "median", "least", "most", "what it correlates with")


def slots(document: Json) -> str:
    """Return how much of the residual anything in each slot could explain on held-out shots."""
    if not document["slots"]:
        if document["slot"] and not document["effects"]:
            slot = html.escape(document["slot"])
            return f"<p>On the line itself, before the impact: the <b>{slot}</b> slot.</p>"
        if document.get("ended_early") and document["remaining"]["structured"]:
            return "<p>This was not tested before the time was over.</p>"
        return "<p>There is nothing to locate.</p>"
    rows = []
    for slot, seen in sorted(document["slots"].items(), key=lambda item: -item[1]["probability"]):
        share = min(seen["share_of_structure"], 1.0)
        bar = f'<span class="bar" style="width:{18 * share:.2f}rem"></span> {_share(share)}'
        cells = (f'<td class="words">{bar}</td>', _share(seen["probability"]))
        rows.append((html.escape(slot), *cells))
    names = [document["slot"], *document.get("also_possible_slots", [])]
    shown = " or ".join(f"<b>{html.escape(name)}</b>" for name in names if name)
    said = f"<p>Most likely the {shown} slot.</p>" if document["slot"] else ""
    if len(names) == len(rows):
        said = "<p>The data do not say which: all slots are about equally likely.</p>"
    head = ("slot", "<span>share of the structure</span>", "probability")
    return (
        f"{said}<p class='soft'>The share of the structure that the most flexible discrepancy of "
        "each slot explains on held-out shots. A named effect must explain as much. A slot's "
        "probability compares its discrepancy with the best one; it is a weight, not a "
        "frequency.</p>" + table(head, rows).replace("<th><span>", '<th class="words"><span>')
    )


def _share(share: float) -> str:
    return "100 %" if share > 0.9995 else f"{100 * share:.1f} %"


def trail(document: Json) -> str:
    """Return every step of the search with its candidates and why they were rejected."""
    parts = []
    unit = unit_of(document)
    for place, turn in enumerate(document["trail"]):
        lines = document["candidates"] if place == 0 else turn["candidates"]
        verdict = "structure" if turn["structured"] else "noise"
        parts.append(
            f"<h3>{place + 1}. {html.escape(turn['model'])}: its residual is {verdict} "
            f"({p_words(turn['p_value'])})</h3>"
        )
        if lines:
            parts.append(f'<div class="wide">{_candidates(lines, unit)}</div>')
    return "".join(parts)


def _candidates(lines: list[Json], unit: Unit) -> str:
    """Return those that were fitted as a table, and below it, folded, those that were not."""
    fitted = [line for line in lines if line["delta_log_likelihood"] is not None]
    others = [line for line in lines if line["delta_log_likelihood"] is None]
    body = []
    for line in fitted:
        held, gain = line["heldout_rms_V"], line["delta_log_likelihood"]
        mark = " class=taken" if line["why_not"] is None else ""
        body.append(
            f"<tr{mark}><td><code>{html.escape(line['form'])}</code></td>"
            f"<td>{html.escape(line['slot'])}</td>"
            f"<td>{html.escape(_owner(line))}</td>"
            f"<td>{'-' if held is None else f'{held * unit.factor:.4g}'}</td>"
            f"<td>{'-' if gain is None else f'{gain:,.0f}'}</td>"
            f'<td class="words">{html.escape(line["why_not"] or "taken")}</td></tr>'
        )
    head = (
        "<tr><th>candidate</th><th>slot</th><th>owner</th>"
        f"<th>held out / {html.escape(unit.label)}</th>"
        '<th>Δ log likelihood</th><th class="words">why not</th></tr>'
    )
    made = f"<table><thead>{head}</thead><tbody>{''.join(body)}</tbody></table>" if body else ""
    return made + _not_fitted(others)


def _owner(line: Json) -> str:
    """Return who has a size of a candidate, and where it acts unless on everything."""
    scope, acts_on = str(line.get("scope", "-")), line.get("acts_on")
    if not acts_on:
        return scope
    return f"each shot {acts_on['words']}" if scope == "shot" else str(acts_on["words"])


def _not_fitted(lines: list[Json]) -> str:
    if not lines:
        return ""
    rows = [
        (
            f"<code>{html.escape(line['form'])}</code>",
            html.escape(line["slot"]),
            f'<td class="words">{html.escape(line["why_not"] or "")}</td>',
        )
        for line in lines
    ]
    return (
        f"<details><summary>{len(rows)} more that were not fitted, or not to the end, and why"
        "</summary>"
        f"{table(('candidate', 'slot', 'why not'), rows)}</details>"
    )


def closure(document: Json) -> str:
    """Return the learned closure in words, and its formula where one was found."""
    learned = document["closure"]
    if learned is None:
        return ""
    before = document["before"].get("heldout_rms_V")
    other = learned.get("by_columns")
    few = f" Without it the best is {_parts(other)}." if other else ""
    return (
        "<h2>The learned discrepancy</h2><p>The unnamed part of the residual is best explained "
        f"by {_parts(learned)}.{_share_of(learned, before)}{few}{_share_of(other or {}, before)}"
        f"</p>{_formula(learned)}"
    )


def _parts(learned: Json) -> str:
    """Return what a closure consists of, and whose its numbers are."""
    parts = learned.get("parts") or [{k: learned[k] for k in ("family", "scope")}]
    return ", and ".join(
        f"<b>{html.escape(FAMILIES.get(part['family'], part['family']))}</b> "
        f"({html.escape(OWNERS.get(part['scope'], 'one set for each ' + part['scope']))})"
        for part in parts
    )


def _share_of(learned: Json, before: float | None) -> str:
    """Return how far a closure brings the error on held-out shots down."""
    after = learned.get("heldout_rms_V")
    if not before or not after:
        return ""
    return f" On held-out shots it reduces the residual {before / after:.3g}-fold."


def _formula(learned: Json) -> str:
    """Return the closure's formula, ``formula`` or ``formula.text`` of its JSON."""
    found = learned.get("formula")
    if isinstance(found, dict):
        found = found.get("text")
    if not found:
        return ""
    return (
        "<p>As a formula that holds on held-out shots:</p>"
        f'<p class="formula">{html.escape(str(found))}</p>'
    )


def coefficients(document: Json) -> str:
    """Return the closure's coefficients, folded."""
    learned = document["closure"]
    if learned is None:
        return ""
    ordered = sorted(learned["coefficients"].items(), key=lambda item: -abs(item[1]))
    rows = [(html.escape(name), f"{value:.4g}") for name, value in ordered]
    shared = (
        f"<details><summary>Its {len(rows)} coefficients, largest first</summary>"
        f"{table(('column', 'coefficient'), rows)}</details>"
    )
    return (shared if rows else "") + _by_shot(learned.get("by_shot") or {})


def _by_shot(numbers: Json) -> str:
    """Return the coefficients that every shot has for itself: their middle, range and company."""
    rows = [
        (
            html.escape(name),
            *(f"{told[key]:.4g}" for key in ("value", "least", "most")),
            html.escape("; ".join(told.get("goes_with") or [])),
        )
        for name, told in numbers.items()
    ]
    if not rows:
        return ""
    return (
        f"<details><summary>{len(rows)} coefficients of its own in every "
        f"shot</summary>{table(_OF_SHOTS, rows)}</details>"
    )


def remains(document: Json) -> str:
    """Return what the last model leaves over."""
    left = document["remaining"]
    if not left["structured"]:
        said = f"<p>Noise: the test finds no structure ({p_words(left['p_value'])}).</p>"
    else:
        family = left.get("strongest", {}).get("family", "")
        what = FAMILIES.get(family, family)
        said = (
            f"<p>Structure ({p_words(left['p_value'])}); the family that explains most of it is "
            f"{html.escape(what)}.</p>"
        )
    after = document["residual"]["after"]
    return said + bullets(after["said"] if after else [])
