"""The words and tables of the page, one function per section."""

from __future__ import annotations

import html
import math

from impactd.aliases import Json
from impactd.diagnosis.markup import bullets, p_words, table
from impactd.diagnosis.repair import MEAN_WAVEFORM, is_repaired
from impactd.diagnosis.set_aside import set_aside, shot_words
from impactd.diagnosis.unit import Unit, unit_of
from impactd.effect_list import effect_list
from impactd.reports.numbers import measured
from impactd.reports.rejected import rejected_words

_PHASES = (
    ("before", "before touch-down"),
    ("contact", "contact"),
    ("ring", "ring after lift-off"),
    ("later", "later"),
)
_QUALITY = (
    ("nrmse", "NRMSE / %", 1e2, ".3g"),
    ("r2", "R²", 1.0, ".6f"),
    ("chi2_per_dof", "χ² per degree of freedom", 1.0, ".4g"),
)


def campaign(document: Json) -> str:
    """Return what the campaign consists of."""
    seen = document["campaign"]
    heights = ", ".join(f"{h * 1e3:.1f}" for h in seen["drop_heights_m"])
    spheres, surfaces = _named(seen["spheres"], "sphere"), _named(seen["surfaces"], "surface")
    said = f"{seen['shots']} shots of {spheres} on {surfaces}"
    said += f", from {heights} mm" if heights else ""
    count = len(set_aside(document))
    return f"{said}; {count} more set aside" if count else said


def _named(names: list[str | None], what: str) -> str:
    """Return names as a list; recordings made elsewhere may have none, which JSON calls None."""
    known = [name if name and name != "None" else f"an unnamed {what}" for name in names]
    return ", ".join(known or [f"an unnamed {what}"])


def headline(document: Json) -> str:
    """Return the figures that matter most: the error, and what the repair moves."""
    before, after = document["before"], document["after"]
    unit = unit_of(document)
    noise = f"noise {_short(document['noise_rms_V'], unit)} {unit.label}"
    cards = []
    if before.get("heldout_rms_V") is not None:
        steps = [_short(before["heldout_rms_V"], unit)]
        if after is not before and after.get("heldout_rms_V") is not None:
            steps.append(_short(after["heldout_rms_V"], unit))
        shown = " → ".join(steps if is_repaired(document) else steps[:1])
        cards.append(
            (f"{shown} {unit.label}", f"error on held-out shots; {noise}{_mean(document)}")
        )
    for name, new in after.get("moduli", {}).items():
        if new["status"] == "withheld":
            cards.append(
                ("withheld", (f"{name}: its modulus; the reason is in the table of moduli"))
            )
        elif new["status"] == "fitted" and document["effects"]:
            change = _change(before.get("moduli", {}).get(name, {}), new)
            cards.append((change, f"{name}: change of its modulus by the repair"))
    p_value = document["p_value"]
    cards.append((p_words(p_value), "that a complete model leaves such a residual by chance"))
    body = "".join(
        f"<div><b>{html.escape(value)}</b><span>{html.escape(label)}</span></div>"
        for value, label in cards
    )
    return f'<div class="figures">{body}</div>'


def set_aside_shots(document: Json) -> str:
    """Return which shots do not belong, and why; nothing where all do."""
    lines = [f"S{shot_words(one)[1:]}. {one['because']}" for one in set_aside(document)]
    if not lines:
        return ""
    return (
        '<h2>Shots set aside</h2><p class="soft">Possible causes are a wrong label, height or '
        "gain, or an off-centre hit: no effect of the rig acts on one shot and not on its "
        "repetitions. The rest of this page uses the other shots. Check the label, or repeat the "
        "drop.</p>" + bullets(lines)
    )


def _mean(document: Json) -> str:
    """Return the residual of the mean of the other hits, after other figures."""
    mean = (document.get("mean_waveform") or {}).get("heldout_rms_V")
    unit = unit_of(document)
    return "" if mean is None else f"; {MEAN_WAVEFORM} {_short(mean, unit)} {unit.label}"


def _short(value: float, unit: Unit) -> str:
    return f"{unit.factor * value:.3g}"


def seen(document: Json) -> str:
    """Return what was seen, the noise that everything else is judged by first."""
    noise = document.get("noise", {}).get("said", [])
    return bullets([*noise, *document["residual"]["before"]["said"]])


def phases(document: Json) -> str:
    """Return where in time the residual lives, before and after, as multiples of the noise."""
    before, after = document["residual"]["before"], document["residual"]["after"]
    if not before.get("phases"):
        return ""
    head = ["", f"{document['before']['model']}"]
    if after and after.get("phases"):
        head.append(document["after"]["model"])
    rows = []
    for key, label in _PHASES:
        cells = [
            _times(one["phases"][key]["chi2_per_sample"])
            for one in (before, after)
            if one and one.get("phases") and key in one["phases"]
        ]
        rows.append((label, *cells))
    return (
        '<p class="soft">Rms of the whitened residual, as a multiple of the noise; 1 is noise.</p>'
        + table([html.escape(one) for one in head], rows)
    )


def _times(value: float | None) -> str:
    """Return the rms of a residual over the noise, of its square."""
    if value is None:
        return "-"
    ratio = math.sqrt(value)
    return f"{ratio:.3g}" if ratio < 1000 else f"{ratio:,.0f}"


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
            f'<p class="soft">{_lives(effect, listed)}</p>'
            + (table(("number", "value ± U (95 %)", "unit"), rows) if rows else "")
        )
        if effect["confusable_with"]:
            names = ", ".join(effect["confusable_with"])
            said = "These data cannot distinguish it from"
            if _cut_short(document):
                said = (
                    "These data cannot distinguish it from the following, or they were not compared"
                )
            parts.append(f"<p>{said}: {html.escape(names)}.</p>")
    return "".join(parts)


def _lives(effect: Json, listed: Json) -> str:
    """Return an effect's slot and its characteristic; for a mistake the remedy."""
    if effect["slot"] == "record":
        return (
            "The campaign was not changed. The moduli use the value that the recordings give. "
            "Weigh or measure again, and correct the stated value."
        )
    tell_tale, source = (html.escape(listed.get(key, "")) for key in ("tell_tale", "source"))
    lives = f"Lives in: {html.escape(effect['slot'])}.{_where(effect)}"
    return f"{lives} Shows as: {tell_tale}. Source: {source}."


def _where(effect: Json) -> str:
    """Return where an effect acts, unless it acts on everything."""
    acts_on = effect.get("acts_on")
    return f" Acts {html.escape(acts_on['words'])} only." if acts_on else ""


def quality(document: Json) -> str:
    """Return the residuals of both models and the noise."""
    unit = unit_of(document)
    sized = (
        ("rms_V", f"rms residual / {unit.label}", unit.factor, ".4g"),
        ("heldout_rms_V", f"held out / {unit.label}", unit.factor, ".4g"),
    )
    mean = document.get("mean_waveform") or {}
    rows = []
    for key, label, factor, form in (*sized, *_QUALITY):
        cells = [
            "-" if value is None else format(value * factor, form)
            for value in (one.get(key) for one in (document["before"], document["after"], mean))
        ]
        noise = format(document["noise_rms_V"] * factor, form) if key.endswith("rms_V") else ""
        rows.append((label, *cells, noise))
    names = [html.escape(document[side]["model"]) for side in ("before", "after")]
    head = ("", f"before: {names[0]}", f"after: {names[1]}", MEAN_WAVEFORM, "noise")
    if not mean.get("reason"):
        return table(head, rows)
    return (
        f'{table(head, rows)}<p class="soft">No {MEAN_WAVEFORM}: {html.escape(mean["reason"])}.</p>'
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
    head = (
        "material",
        "status",
        "E before ± U (95 %) / GPa",
        "E after ± U (95 %) / GPa",
        "change",
        "",
    )
    return f'<div class="wide">{table(head, rows)}</div>'


def _measured(quantity: Json | None, *, scale: float = 1.0) -> str:
    return html.escape(measured(quantity, scale=scale, sign="±"))


def _gigapascals(entry: Json, key: str) -> str:
    return _measured(entry.get(key), scale=1e-9)


def _change(old: Json, new: Json) -> str:
    a, b = old.get("plane_strain_modulus_Pa"), new.get("plane_strain_modulus_Pa")
    return f"{100 * (b['value'] / a['value'] - 1):+.2f} %" if a and b else "-"


def next_drop(document: Json) -> str:
    """Return which drop would tell most."""
    wanted = document["next_drop"]
    if wanted is None:
        if document.get("ended_early") and document["verdict"] in ("family", "partial", "unknown"):
            return "This was not tested before the time was over. Diagnose again with more time."
        if document["verdict"] == "unknown" and not is_repaired(document):
            return (
                "No drop helps: the disturbance is there without an impact. Record the line with "
                "valve, motors and supplies switched off in turn."
            )
        if document["verdict"] == "unknown":
            return (
                "No drop is proposed: a proposal needs two named rivals. More heights and radii "
                "restrict the discrepancy."
            )
        return "The result needs no further drop."
    if wanted.get("sentence"):
        return html.escape(str(wanted["sentence"]))
    times = wanted.get("repeats") or 1
    said = (
        f"<b>{html.escape(str(wanted['sphere']))} on {html.escape(str(wanted['surface']))} from "
        f"{1e3 * wanted['drop_height_m']:.1f} mm</b>"
    )
    said += f", {times} times" if times > 1 else ""
    rivals = [f"<code>{html.escape(one)}</code>" for one in wanted.get("separates") or []]
    if rivals:
        said += f": it distinguishes {' from '.join(rivals)}"
    distance = wanted.get("expected_distance")
    if distance is not None:
        said += f", {distance:.3g} noise units between them"
    return f"{said}."


def _cut_short(document: Json) -> bool:
    """Return whether the time was over before the search for names had ended."""
    ended = document.get("ended_early")
    return ended is not None and not ended["verdict_stands"]


def conditions(document: Json) -> str:
    """Return the assumptions and the rejected shots."""
    lines = list(document["assumptions"])
    lines += [rejected_words(one) for one in document["rejected"]]
    unit = unit_of(document)
    noise = document["noise_rms_V"] * unit.factor
    lines.append(f"Noise before the trigger: {noise:.4g} {unit.label} rms.")
    return bullets(lines)
