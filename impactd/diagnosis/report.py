"""One self-contained page that says what was seen, what it is, and what it changes.

Everything comes from the JSON of the diagnosis, so a page can be made again at any time without
the recordings.
"""

from __future__ import annotations

import html
from pathlib import Path
from string import Template

from analysis.plots.span import span_us
from impactd.aliases import Json
from impactd.diagnosis import budgets, closure_figures, figures, sections, trail
from impactd.diagnosis.set_aside import set_aside
from impactd.diagnosis.style import STYLE
from impactd.diagnosis.unit import Unit, unit_of

ORDER_MATTERS = 0.01
"""p value of a drift from which the order of the shots is shown."""

_PAGE = Template("""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>impactd diagnosis: $verdict</title>
<style>$style</style>
</head>
<body>
<h1>Does the model explain these impacts?</h1>
<p class="soft">$campaign</p>
<p class="verdict $verdict"><b>$verdict</b> $sentence</p>
$headline
$set_aside
$found
<h2>The error before and after</h2>
<p class="soft">Held out: the error on shots to which the shared parameters were not fitted. If
the model is complete, it equals the noise before the trigger. The mean of the other hits needs no
model: only size, shift, stretch and offset of each hit are fitted.</p>
<div class="wide">$quality</div>
<h2>What was seen</h2>
$seen
$residual_before
$phases
$in_time
$spectra
<h2>Which slot</h2>
$slots
<h2>Steps of the search</h2>
$trail
$closure
<h2>Moduli before and after</h2>
$moduli
$budgets
<h2>What remains</h2>
$remains
$residual_after
<h2>What to drop next</h2>
<p>$next_drop</p>
<h2>Conditions</h2>
$conditions
<p class="soft">$software. This page was made from the diagnosis' JSON alone.</p>
</body>
</html>
""")


def write_report(file: Path, document: Json) -> None:
    """Write the page.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.
    """
    file.write_text(page(document), encoding="utf-8")


def page(document: Json) -> str:
    """Return the page.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.
    """
    before, after = document["residual"]["before"], document["residual"]["after"]
    noise, unit = document["noise_rms_V"], unit_of(document)
    repaired = None if after is None or not after.get("stacks") else after
    span = span_us(before["stacks"]) if before.get("stacks") else (0.0, 0.0)
    return _PAGE.substitute(
        style=STYLE,
        verdict=html.escape(document["verdict"]),
        sentence=html.escape(document["sentence"]),
        campaign=html.escape(sections.campaign(document)),
        headline=sections.headline(document),
        set_aside=_set_aside(document, unit),
        found=sections.found(document),
        quality=sections.quality(document),
        seen=sections.seen(document),
        residual_before=_stack(
            before,
            noise,
            f"Residual of {document['before']['model']}, stacked over repetitions",
            unit,
            span,
        ),
        phases=sections.phases(document),
        in_time=_in_time(before, document["closure"], unit),
        spectra=_picture(
            figures.spectra(before["spectrum"], repaired["spectrum"] if repaired else None, unit)
            if before.get("spectrum")
            else None,
            "Power density of the residual and of the noise before the trigger",
        ),
        slots=trail.slots(document),
        trail=trail.trail(document),
        closure=trail.closure(document)
        + _learned(document["closure"], unit)
        + trail.coefficients(document),
        moduli=_picture(
            figures.moduli(document["before"]["moduli"], document["after"]["moduli"])
            if document["effects"]
            else None,
            "Plane-strain moduli before and after, with 95 % intervals",
        )
        + sections.moduli(document),
        budgets=_budgets(document),
        remains=trail.remains(document),
        residual_after=_stack(
            repaired,
            noise,
            f"Residual of {document['after']['model']}, stacked over repetitions",
            unit,
            span,
        )
        if repaired
        else "",
        next_drop=sections.next_drop(document),
        conditions=sections.conditions(document),
        software=html.escape(document["software"]),
    )


def _set_aside(document: Json, unit: Unit) -> str:
    """Return which shots do not belong, each with its record and what the model makes of it."""
    drawn = [one for one in set_aside(document) if one.get("curves")]
    more = len(drawn) - figures.MOST_SET_ASIDE
    return sections.set_aside_shots(document) + _picture(
        figures.set_aside_shots(drawn, document["noise_rms_V"], unit),
        "The record, and the model's best fit with the label as stated. Below: the residual; "
        "grey: one standard deviation of a sample's noise."
        + (f" {more} more are not drawn." if more > 0 else ""),
    )


def _budgets(document: Json) -> str:
    """Return what the uncertainty of every modulus that was found is made of."""
    block = document["after"]
    stated = [name for name, one in block["moduli"].items() if one["status"] == "fitted"]
    made = budgets.section(block.get("budget"), stated)
    return f"<h2>Uncertainty budgets</h2>{made}" if made else ""


def _in_time(seen: Json, closure: Json | None, unit: Unit) -> str:
    """Return the residual early and late in the campaign where its order matters."""
    p_value = (seen.get("order") or {}).get("p_value")
    drifts = p_value is not None and p_value < ORDER_MATTERS
    if not seen.get("stacks") or not (drifts or (closure and closure["scope"] == "order")):
        return ""
    return _picture(
        figures.in_time(seen["stacks"], unit),
        "The residual changes in the course of the campaign: its mean over early and late shots.",
    )


def _learned(closure: Json | None, unit: Unit) -> str:
    if closure is None:
        return ""
    drawn = _picture(
        closure_figures.course(closure["coefficients"]), ("The discrepancy over time.")
    )
    if "curves" not in closure:
        return drawn
    curves = closure["curves"]
    return (
        drawn
        + _picture(
            closure_figures.closure(curves, unit),
            "For each owner (for each pair, if every shot has its own numbers) the shot to which "
            "the discrepancy adds most: its residual, and the residual with the discrepancy.",
        )
        + _picture(
            closure_figures.force(curves), "The learned force, as a share of the elastic one."
        )
    )


def _stack(seen: Json, noise_rms: float, title: str, unit: Unit, span: tuple[float, float]) -> str:
    if not seen.get("stacks"):
        return ""
    return _picture(
        figures.stacked(seen["stacks"], noise_rms, title, unit, span),
        "Mean over repetitions. Grey: the contact; hatched: one standard deviation of a sample's "
        "noise.",
    )


def _picture(source: str | None, caption: str) -> str:
    if source is None:
        return ""
    said = html.escape(caption)
    return f'<figure><img alt="{said}" src="{source}"><figcaption>{said}</figcaption></figure>'
