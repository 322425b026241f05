"""``impactd fit``: a campaign folder here, or stored shots by the daemon."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from analysis.written_numbers import counted, decimals, measured
from impactd.advice import in_words
from impactd.client.talk import fresh_key
from impactd.console.client import connect
from impactd.console.failure import Failure
from impactd.console.progress_bar import progress
from impactd.console.spreadsheet import write_csv
from impactd.console.tables import print_json, table, wrapped
from impactd.reports.rejected import rejected_words

_NAMED = 4
"""So many hits are named in a sentence about several."""

if TYPE_CHECKING:
    from analysis.fit.result import FitResult


def offline(
    path: Path,
    model: str,
    *,
    json_out: Path | None,
    csv_out: Path | None = None,
    identifiability: bool = False,
) -> None:
    """Fit a campaign folder in this process and print what was found.

    Parameters
    ----------
    path : Path
        ``campaign.json`` or its folder.
    model : str
        ``hsd`` or ``kv``.
    json_out : Path or None
        Where the result goes as ``impactd-fit/1``; ``-`` prints it instead of the tables.
    csv_out : Path or None
        Where the numbers go for a spreadsheet.
    identifiability : bool
        Also take the profile likelihood of every shared parameter, and say what the shots fix.

    Raises
    ------
    Failure
        If no shot could be fitted.
    """
    from analysis import fit_campaign
    from impactd.jobs.rebound import with_later_landings
    from impactd.storage.campaign_folder import read_campaign
    from impactd.storage.version import software

    campaign = with_later_landings(read_campaign(path), model)
    result = fit_campaign(campaign, model, progress=lambda what, share: progress(what, share=share))
    progress("", last=True)
    document = {**result.to_json(), "software": software()}
    usable = document["outcome"]["status"] != "not_evaluable"
    if identifiability and usable:
        document["identifiability"] = _profiled(result)
    _deliver(document, json_out, csv_out)
    if identifiability and usable and json_out != Path("-"):
        print("\nWhat these shots determine, and what they do not:")
        print("\n".join(f"- {line}" for line in document["identifiability"]["sentences"]))
    if document["outcome"]["status"] == "not_evaluable":
        raise Failure(f"{path}: {document['outcome']['message']}")


def _profiled(result: FitResult) -> dict[str, Any]:
    """Return the report with a profile likelihood for every shared parameter."""
    from analysis.fit.profile import profile

    names = result.problem.names
    found = []
    for done, name in enumerate(names):
        progress(f"profile of {name}", share=done / len(names))
        found.append(profile(result.problem, result.fitted, name))
    progress("", last=True)
    return dataclasses.replace(result.identifiability(), profiles=tuple(found)).to_json()


def by_the_daemon(
    numbers: list[int],
    model: str,
    *,
    json_out: Path | None,
    csv_out: Path | None = None,
    url: str | None,
) -> None:
    """Have the daemon fit stored shots and print what was found.

    Parameters
    ----------
    model : str
        ``hsd`` or ``kv``.
    json_out : Path or None
        Where the results go; ``-`` prints them.
    csv_out : Path or None
        Where the numbers go for a spreadsheet.

    Raises
    ------
    Failure
        If the fit failed.
    """
    with connect(url) as client:
        job = client.send("POST", "/v1/fits", {"shots": numbers, "model": model}, key=fresh_key())
        job = client.wait(
            f"/v1/fits/{job['id']}",
            lambda answer: answer["state"] in ("done", "failed"),
            lambda state, share: progress(f"fit {job['id']}: {state}", share=share),
        )
        progress("", last=True)
    if job["state"] == "failed":
        raise Failure(f"fit {job['id']} of {job['subject']} failed: {job['reason']}")
    for fit in job["fits"]:
        _deliver(fit["result"], json_out, csv_out)


def _deliver(document: dict[str, Any], json_out: Path | None, csv_out: Path | None) -> None:
    if csv_out is not None:
        write_csv(csv_out, document)
    if json_out == Path("-"):
        print_json(document)
        return
    if json_out is not None:
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
        json_out.write_text(text + "\n", encoding="utf-8")
    print(report(document))


def report(document: dict[str, Any]) -> str:
    """Return a fit as the tables a person reads.

    Parameters
    ----------
    document : dict
        ``impactd-fit/1``.

    Returns
    -------
    str
        What speaks against it, pairs, materials, quality, and what was rejected.
    """
    parts = [f"Model {document['model']}: {document.get('sentence') or _outcome(document)}"]
    parts += _warnings(document)
    if document.get("pairs"):
        parts.append(_pairs(document))
    if document.get("moduli"):
        parts.append(moduli_table(document["moduli"]))
        parts.append(_together(document))
    if "r2" in document:
        heldout = document.get("heldout_rms_V")
        parts.append(
            f"R2 {document['r2']:.6f}, NRMSE {document.get('nrmse', 0):.2e}, "
            f"chi2/dof {document['chi2_per_dof']:.3g}"
            + (f", held-out rms {heldout:.3g}" if heldout else "")
        )
    if "sentence" not in document:  # a fit of an earlier version
        parts += [one["sentence"] for one in document.get("conflicts") or []]
    parts += map(wrapped, _improvements(document))
    parts += map(wrapped, document.get("assumptions") or [])
    parts += [rejected_words(item) for item in document.get("rejected") or []]
    return "\n\n".join(parts)


def _together(document: dict[str, Any]) -> str:
    """Return which records the moduli of a fit rest on, as `impactd moduli` has others."""
    hits = counted(len(document["shots"]), "hit")
    return wrapped(
        f"These moduli are from one fit to the records of {hits}, with the load cell's numbers "
        f"free too{known_moduli(document['moduli'])}. `impactd moduli` adjusts the E* of all "
        "stored shots instead: the last digits may differ."
    )


def known_moduli(moduli: dict[str, Any]) -> str:
    """Return which materials were known beforehand, to go on with a sentence."""
    names = [name for name, one in moduli.items() if one["status"] == "reference"]
    return f"; known beforehand: {', '.join(names)}" if names else "; no modulus known beforehand"


def _improvements(document: dict[str, Any]) -> list[str]:
    """Return, for every modulus that was to be found, what would lessen its uncertainty most."""
    budgets = (document.get("budget") or {}).get("moduli") or {}
    return [
        f"u of E/(1-nu^2) of {name}: {one['plane_strain_modulus_Pa']['improve']}"
        for name, one in budgets.items()
        if document["moduli"][name]["status"] == "fitted"
    ]


def _outcome(document: dict[str, Any]) -> str:
    outcome = document.get("outcome") or {}
    return str(outcome.get("message", "")) if isinstance(outcome, dict) else str(outcome)


def _warnings(document: dict[str, Any]) -> list[str]:
    outcome = document.get("outcome")
    ending = outcome.get("status") if isinstance(outcome, dict) else outcome  # told already
    flags = document.get("flags") or []
    told = [in_words(flag) for flag in flags if flag != ending]
    shots = document.get("shots") or []
    of_shots = dict.fromkeys(flag for shot in shots for flag in shot.get("flags") or [])
    for flag in (one for one in of_shots if one not in flags):
        names = [str(shot["name"]) for shot in shots if flag in (shot.get("flags") or [])]
        told.append(f"{_some_of(names, len(shots))}: {in_words(flag)}")
    told = [wrapped(sentence, "  - ") for sentence in told]
    return ["\n".join(["Mind that", *told])] if told else []


def _some_of(names: list[str], hits: int) -> str:
    """Return which hits of a fit something holds for, the first few by name."""
    if hits == 1:
        return names[0]
    named = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
    return f"{len(names)} of {hits} hits ({named})"


def _pairs(document: dict[str, Any]) -> str:
    rows = []
    for name, pair in document["pairs"].items():
        if "reduced_modulus_Pa" in pair:
            value, unit = measured(pair["reduced_modulus_Pa"], scale=1e-9), "GPa (E*)"
        elif "stiffness" in pair:
            value, unit = measured(pair["stiffness"]), "N m^-1.5 (K)"
        else:
            value, unit = measured(pair.get("stiffness_over_mass")), "N m^-1.5 kg^-1 (K/m)"
        rows.append(
            (name, document["model"], value, unit, pair["shots"], _worst_r2(document, name))
        )
    return table(("pair", "model", "value +- U (95 %)", "unit", "hits", "lowest R2"), rows)


def _worst_r2(document: dict[str, Any], pair: str) -> float | None:
    """Return the lowest R2 of a pair's shots, where the shots say which pair they are."""
    found = [
        shot["r2"]
        for shot in document.get("shots") or []
        if pair == shot.get("pair", _pair_name(shot)) and shot.get("r2") is not None
    ]
    return min(found) if found else None


def _pair_name(shot: dict[str, Any]) -> str:
    return f"{shot.get('sphere')}/{shot.get('surface')}"


def moduli_table(moduli: dict[str, Any]) -> str:
    """Return the moduli of materials as a table.

    Parameters
    ----------
    moduli : dict
        By material, as in ``impactd-fit/1``.

    Returns
    -------
    str
        One line per material, and below why some are withheld.
    """
    rows = []
    for name, modulus in moduli.items():
        young, plane = modulus["youngs_modulus_Pa"], modulus["plane_strain_modulus_Pa"]
        rows.append(
            (
                name,
                modulus["status"],
                measured(young, scale=1e-9),
                _interval(young),
                measured(plane, scale=1e-9),
                _note(modulus),
            )
        )
    headings = ("material", "status", "E +- U (95 %)/GPa", "interval/GPa", "E/(1-nu^2)/GPa", "note")
    reasons = [
        wrapped(f"{name} is {modulus['status']}: {modulus['reason']}.")
        for name, modulus in moduli.items()
        if modulus.get("reason")
    ]
    return "\n".join([table(headings, rows), *reasons])


def _note(modulus: dict[str, Any]) -> str:
    """Return what was stated of a reference beforehand."""
    stated = modulus.get("stated_youngs_modulus_Pa")
    return f"stated {measured(stated, scale=1e-9)}" if stated else ""


def _interval(quantity: dict[str, Any] | None) -> str:
    if not quantity or not quantity.get("interval95"):
        return "-"
    low, high = (end * 1e-9 for end in quantity["interval95"])
    digits = decimals((high - low) / 2) if high > low else 3
    return f"{low:.{digits}f} .. {high:.{digits}f}"
