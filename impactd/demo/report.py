"""report.html: the demo's result on one page, complete in one file."""

from __future__ import annotations

import base64
import html
import math
from pathlib import Path
from string import Template
from typing import Any

from impactd import __version__
from impactd.demo.outcome import Estimate, Outcome, Row

_PAGE = Template("""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>impactd demo</title>
<style>
  :root { --ink: #202124; --soft: #5f6570; --line: #e4e6ea; --kv: #1c6dd0; --hsd: #b5651d; }
  body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); margin: 0 auto; max-width: 64rem;
         padding: 2rem 1rem 4rem; }
  h1 { font-size: 1.5rem; margin: 0; }
  h2 { font-size: 1.1rem; margin: 2.2rem 0 .6rem; }
  p, .soft { color: var(--soft); }
  .verdict { color: var(--ink); font-size: 1.15rem; border-left: 4px solid var(--kv);
             padding: .3rem 0 .3rem .8rem; }
  .wide { overflow-x: auto; }
  table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
  th, td { text-align: right; white-space: nowrap; padding: .35rem .6rem;
           border-bottom: 1px solid var(--line); }
  th:first-child, td:first-child { text-align: left; }
  th { font-weight: 600; color: var(--soft); font-size: .88rem; }
  .hsd { color: var(--hsd); } .kv { color: var(--kv); font-weight: 600; }
  figure { margin: 1rem 0; } img { max-width: 100%; height: auto; }
  figcaption { color: var(--soft); font-size: .9rem; }
  ul { padding-left: 1.2rem; color: var(--soft); }
</style>
</head>
<body>
<h1>From a drop to a modulus</h1>
<p>One run of <code>impactd demo</code>: $drops drops on the simulated rig (seed $seed) through
HTTP, the USB protocol and a serial line, as on a real one. The daemon did not know the truth, which
was sealed until its last fit was in.</p>
<p class="verdict">$sentence</p>

<h2>Reduced modulus E* of each pair</h2>
<p>The one number that a contact knows. HSD takes the load cell for rigid and reads the moduli of
polymers too high; KV lets its crystal move (Maranzano &amp; Hancock 2016, Tables 4 and 5).</p>
<div class="wide">$pairs</div>

<h2>Young's modulus of each material</h2>
<p>From the network of all pairs and what was stated before. Poisson's ratio is never seen by a
normal impact; its uncertainty is inside.</p>
<div class="wide">$materials</div>

<figure><img alt="Deviation of each modulus from the truth, with 95 % intervals" src="$moduli_png">
</figure>

<h2>One shot</h2>
<figure><img alt="A trace with the fits of HSD and KV, and their residuals" src="$trace_png">
<figcaption>What a model leaves over shows what it lacks. The crystal's ring after the pulse is what
HSD cannot have.</figcaption></figure>

$diagnosis
<h2>The load cell</h2>
<p>Calibration $calibration, from $calibration_drops drops of reference spheres. Identifiable
combinations first; mass, stiffness and damping by themselves stay as uncertain as they are.</p>
<div class="wide">$sensor</div>

<h2>What the simulated rig had sealed</h2>
<ul>$sealed</ul>
<p class="soft">$software. Beside this file: <code>moduli.json</code>, the shots as a campaign
folder (<code>shots/campaign.json</code>) and the archive with the original HDF5 files
(<code>archive/shots</code>).</p>
</body>
</html>
""")


_KNOWN = ' <span class="soft">(known before)</span>'


def write_report(file: Path, outcome: Outcome, pictures: dict[str, Path]) -> None:
    """Write the page.

    Parameters
    ----------
    file : Path
        Where to.
    outcome : Outcome
        What was found.
    pictures : dict
        PNG files by name: ``trace``, ``moduli``.
    """
    effects = outcome.truth.get("effects") or []
    sealed = [_effect(effect) for effect in effects] or ["No effect: the base model was complete."]
    page = _PAGE.substitute(
        drops=len(outcome.calibration["drops"]) + len(outcome.fits["kv"]["shots"]),
        seed=outcome.seed,
        sentence=html.escape(outcome.sentence()),
        pairs=_table("pair", outcome.pairs),
        materials=_table("material", outcome.materials),
        moduli_png=_inline(pictures["moduli"]),
        trace_png=_inline(pictures["trace"]),
        # The diagnosis of the residual gets its section here once the loop can be closed.
        diagnosis="",
        calibration=outcome.calibration["number"],
        calibration_drops=len(outcome.calibration["drops"]),
        sensor=_sensor(outcome),
        sealed="".join(f"<li>{line}</li>" for line in sealed),
        software=html.escape(f"impactd {__version__}"),
    )
    file.write_text(page, encoding="utf-8")


def gigapascals(estimate: Estimate | None) -> str:
    """Return an estimate with its standard uncertainty, to two digits of it.

    Parameters
    ----------
    estimate : Estimate or None
        ``None``: withheld.

    Returns
    -------
    str
        E.g. ``2.35 ± 0.04``, in GPa.
    """
    if estimate is None:
        return "withheld"
    digits = _digits(estimate)
    return f"{estimate.value_pa / 1e9:.{digits}f} ± {estimate.u_pa / 1e9:.{digits}f}"


def true_gigapascals(row: Row) -> str:
    """Return a row's truth, to the digits of KV's estimate.

    Parameters
    ----------
    row : Row
        Pair or material.

    Returns
    -------
    str
        In GPa.
    """
    return f"{row.truth_pa / 1e9:.{_digits(row.kv)}f}"


def _digits(estimate: Estimate | None) -> int:
    """Return how many decimals of a value in GPa its uncertainty supports."""
    if estimate is None:
        return 3
    return next((n for n in range(5) if estimate.u_pa / 1e9 >= 0.95 * 10.0 ** (1 - n)), 5)


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


def _table(what: str, rows: list[Row]) -> str:
    body = "".join(
        f"<tr><td>{html.escape(row.name)}{_KNOWN if row.known else ''}</td>"
        f"<td>{row.shots}</td>"
        f'<td class="hsd">{gigapascals(row.hsd)}</td><td class="kv">{gigapascals(row.kv)}</td>'
        f"<td>{_interval(row.kv)}</td><td>{true_gigapascals(row)}</td>"
        f"<td>{inside(row.kv, row.truth_pa)}</td></tr>"
        for row in rows
    )
    return (
        f"<table><thead><tr><th>{what}</th><th>shots</th><th>HSD ± u / GPa</th>"
        "<th>KV ± u / GPa</th><th>KV, 95 % / GPa</th><th>truth / GPa</th><th>inside?</th></tr>"
        f"</thead><tbody>{body}</tbody></table>"
    )


def _interval(estimate: Estimate | None) -> str:
    if estimate is None:
        return "-"
    digits = _digits(estimate)
    return " … ".join(f"{limit / 1e9:.{digits}f}" for limit in estimate.interval95_pa)


def _sensor(outcome: Outcome) -> str:
    """Return the cell's parameters as the KV fit of the campaign ended with them."""
    fitted = {
        name.removeprefix("sensor."): found
        for name, found in outcome.fits["kv"].get("parameters", {}).items()
        if name.startswith("sensor.") and found is not None
    }
    truth = _true_sensor(outcome.truth.get("sensor", {}))
    # truth names the combinations first; units in names differ only in their capitals
    order = [key.lower() for key in truth]
    rows = [
        f"<tr><td>{html.escape(name)}</td><td>{found['value']:.5g} ± {found['u']:.2g}</td>"
        f"<td>{truth.get(name.lower(), math.nan):.5g}</td></tr>"
        for name, found in sorted(
            fitted.items(),
            key=lambda item: order.index(item[0].lower()) if item[0].lower() in order else 99,
        )
    ]
    head = "<tr><th>parameter</th><th>KV ± u</th><th>truth</th></tr>"
    return f"<table><thead>{head}</thead><tbody>{''.join(rows)}</tbody></table>"


def _true_sensor(sealed: dict[str, Any]) -> dict[str, float]:
    """Return the true cell by lower-case name, the combinations that a trace can tell first."""
    plain = {key.lower(): value for key, value in sealed.items() if isinstance(value, float)}
    if "crystal_mass_kg" not in plain:
        return plain
    mass, stiffness = plain["crystal_mass_kg"], plain["crystal_stiffness_n_per_m"]
    damping, compliance = plain["crystal_damping_n_s_per_m"], plain["compliance_m_per_v"]
    return {
        "gain_n_per_v": stiffness * compliance,
        "natural_frequency_hz": math.sqrt(stiffness / mass) / (2 * math.pi),
        "damping_ratio": damping / (2 * math.sqrt(stiffness * mass)),
    } | plain


def _effect(effect: dict[str, Any]) -> str:
    name = str(effect.get("id", "effect"))
    parameters = effect.get("parameters", {})
    said = ", ".join(f"{key} = {value:.4g}" for key, value in parameters.items())
    return f"<code>{html.escape(name)}</code>: {html.escape(said)}"


def _inline(picture: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(picture.read_bytes()).decode()
