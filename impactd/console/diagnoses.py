"""``impactd diagnose``: a campaign folder here, or stored shots by the daemon."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import json
import textwrap
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from analysis.written_numbers import measured
from impactd.client.connection import Connection
from impactd.client.talk import fresh_key
from impactd.console.client import connect
from impactd.console.failure import Failure
from impactd.console.fits import moduli_table
from impactd.console.progress_bar import progress, progress_by_step
from impactd.console.spreadsheet import write_csv
from impactd.console.tables import print_json, table, wrapped
from impactd.diagnosis.repair import MEAN_WAVEFORM, is_repaired
from impactd.diagnosis.set_aside import likely_words, set_aside, shot_words
from impactd.reports.rejected import rejected_words

MOST_SHOTS = 500
"""As many as the daemon takes into one diagnosis."""
WIDTH = 100
"""Of a line of words, in columns: half of a wide screen."""
_UNITS = {"voltage": "V", "force_N": "N", "acceleration_m_per_s2": "m/s^2"}


def offline(
    path: Path,
    base: str | None,
    *,
    budget_s: float | None,
    json_out: Path | None,
    csv_out: Path | None = None,
    report: Path | None,
    pdf: Path | None = None,
) -> None:
    """Diagnose a campaign folder in this process.

    Parameters
    ----------
    path : Path
        ``campaign.json`` or its folder.
    base : str or None
        ``kv2``, ``kv`` or ``hsd``; None takes ``kv2``, or ``kv`` where the records obey that.
    budget_s : float or None
        How long it may search. [s]
    json_out : Path or None
        Where ``impactd-diagnosis/1`` goes; ``-`` prints it instead of the tables.
    csv_out : Path or None
        Where the numbers go for a spreadsheet.
    report, pdf : Path or None
        Where the page goes, and the sheet for the file.
    """
    from impactd.diagnosis.run import diagnose
    from impactd.storage.campaign_digest import campaign_files
    from impactd.storage.campaign_folder import read_campaign

    campaign = read_campaign(path, calibrated=False)
    document = diagnose(campaign, base, budget_s=budget_s, progress=progress_by_step())
    progress("", last=True)
    if report is not None:
        from impactd.diagnosis.report import write_report

        write_report(report, document)
    if csv_out is not None:
        write_csv(csv_out, document)
    if pdf is not None:
        folder = path if path.is_dir() else path.parent
        _write_pdf(pdf, document, folder.resolve().name, campaign_files(path))
    _deliver(document, json_out, report, pdf)


def by_the_daemon(
    numbers: list[int],
    base: str,
    *,
    budget_s: float | None,
    json_out: Path | None,
    csv_out: Path | None = None,
    report: Path | None,
    pdf: Path | None = None,
    url: str | None,
) -> None:
    """Have the daemon diagnose stored shots.

    Parameters
    ----------
    numbers : list of int
        Shots; none means all, the newest 500.
    base : str
        ``kv2``, ``kv`` or ``hsd``.
    budget_s : float or None
        How long it may search once it runs. [s]
    json_out : Path or None
        Where the result goes; ``-`` prints it.
    csv_out : Path or None
        Where the numbers go for a spreadsheet.
    report, pdf : Path or None
        Where the page goes, and the sheet for the file.

    Raises
    ------
    Failure
        If it failed or was cancelled, here (Ctrl-C) or elsewhere.
    """
    with connect(url) as client:
        shots = sorted(numbers) or _all_shots(client)
        if not shots:
            raise Failure("the archive has no shots yet; make drops, or name a campaign file.")
        body: dict[str, Any] = {"shots": shots, "base": base}
        if budget_s is not None:
            body["budget_s"] = budget_s
        made = client.send("POST", "/v1/diagnoses", body, key=fresh_key())
        at = f"/v1/diagnoses/{made['id']}"
        made = _watch(client, at, made["id"])
        if made["state"] != "done":
            raise Failure(f"diagnosis {made['id']} {made['state']}: {made['reason']}")
        if report is not None:
            client.download(f"{at}/report.html", report)
    if csv_out is not None:
        write_csv(csv_out, made["result"])
    if pdf is not None:
        result = made["result"]
        names = [f"{number:06d}.h5" for number in result["shot_numbers"]]
        files = dict(zip(names, result["file_sha256"], strict=True))
        _write_pdf(pdf, result, f"Diagnosis {made['id']}", files)
    _deliver(made["result"], json_out, report, pdf, number=made["id"])


def _write_pdf(file: Path, document: dict[str, Any], name: str, files: dict[str, str]) -> None:
    from impactd.diagnosis.result_sheet import Source, write_result_sheet

    write_result_sheet(file, document, Source(name, files), datetime.now(UTC))


def _watch(client: Connection, at: str, number: int) -> dict[str, Any]:
    """Return the diagnosis once it has ended; Ctrl-C cancels it, which leaves nothing half done."""
    tell = progress_by_step()
    try:
        return client.wait(
            at,
            lambda answer: answer["state"] in ("done", "failed", "cancelled"),
            lambda state, share: tell(f"diagnosis {number} {state}", share),
        )
    except KeyboardInterrupt:
        client.send("DELETE", at)
        raise Failure(f"diagnosis {number} was cancelled.") from None
    finally:
        progress("", last=True)


def _all_shots(client: Connection) -> list[int]:
    return sorted(int(item["number"]) for item in client.pages("/v1/shots", MOST_SHOTS))


def _deliver(
    document: dict[str, Any],
    json_out: Path | None,
    report: Path | None,
    pdf: Path | None,
    *,
    number: int | None = None,
) -> None:
    if json_out == Path("-"):
        print_json(document)
        return
    if json_out is not None:
        text = json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False)
        json_out.write_text(text + "\n", encoding="utf-8")
    print(summary(document, number=number))
    for what, file in (("Report", report), ("PDF", pdf)):
        if file is not None:
            print(f"\n{what}: {file}")


def summary(document: dict[str, Any], *, number: int | None = None) -> str:
    """Return a diagnosis as a person reads it on a terminal.

    Parameters
    ----------
    document : dict
        ``impactd-diagnosis/1``.
    number : int, optional
        Under which the daemon keeps it.

    Returns
    -------
    str
        Verdict, numbers of what was found, before and after, moduli, candidates.
    """
    parts = [wrapped(f"{document['verdict'].upper()}: {document['sentence']}")]
    parts += _set_aside(document)
    if document["effects"]:
        rows = [
            (effect["id"], name, measured(value), value["unit"])
            for effect in document["effects"]
            for name, value in effect["parameters"].items()
        ]
        if rows:
            parts.append(table(("effect", "parameter", "value +- U (95 %)", "unit"), rows))
    blocks = [document["before"]]
    if is_repaired(document):
        blocks.append(document["after"])
    keys = ("rms_V", "heldout_rms_V", "nrmse", "r2", "chi2_per_dof")
    unit = _unit(document)
    shown = (f"rms / {unit}", f"held out / {unit}", "NRMSE", "R2", "chi2/dof")
    mean = document.get("mean_waveform") or {}
    named = _named(blocks)
    models = [
        (name, *(_digits(block.get(key), key) for key in keys))
        for name, block in [*named, (MEAN_WAVEFORM, mean)]
    ]
    parts.append(
        table(("model", *shown), models)
        + (f"\nno {MEAN_WAVEFORM}: {mean['reason']}" if mean.get("reason") else "")
        + f"\nnoise: {document['noise_rms_V']:.4g} {unit} rms"
        + "".join(f"\n{line}" for line in document.get("noise", {}).get("said", []))
    )
    parts += [
        f"Moduli under {name}:\n{moduli_table(block['moduli'])}"
        for name, block in named
        if block.get("moduli")
    ]
    tried = [c for c in document["candidates"] if c["delta_log_likelihood"] is not None]
    if tried:
        lines = [(c["id"], c["heldout_rms_V"], c["why_not"] or "taken") for c in tried]
        parts.append(table(("candidate", f"held out / {unit}", ""), lines))
    if document["next_drop"]:
        parts.append(_drop_next(document["next_drop"], number))
    parts += [rejected_words(item) for item in document["rejected"]]
    return "\n\n".join(parts)


def _digits(value: float | None, key: str) -> str:
    """Return an error of a model, with the digits that a fit prints of it."""
    if value is None:
        return "-"
    return f"{value:.6f}" if key == "r2" else f"{value:.3g}"


def _named(blocks: list[dict[str, Any]]) -> list[tuple[str, dict[str, Any]]]:
    """Return each block under its model; one whose model stayed has another stated value."""
    names = [str(block["model"]) for block in blocks]
    if len(names) == 2 and names[0] == names[1]:
        names = [f"{names[0]}, as stated", f"{names[1]}, with what was found"]
    return list(zip(names, blocks, strict=True))


def _set_aside(document: dict[str, Any]) -> list[str]:
    """Return the shots that do not belong, one a line; nothing where all do."""
    lines = []
    for one in set_aside(document):
        likely = likely_words(one)
        line = f"Set aside: {shot_words(one)}" + (f": most like {likely}" if likely else "")
        lines.append(textwrap.fill(line, WIDTH, subsequent_indent="  "))
    return ["\n".join(lines)] if lines else []


def _unit(document: dict[str, Any]) -> str:
    """Return what the recordings were made in; the JSON's ``_V`` stands for it."""
    units = {_UNITS[quantity] for quantity in document["campaign"].get("quantities", ["voltage"])}
    return units.pop() if len(units) == 1 else "of each record"


def _drop_next(wanted: dict[str, Any], number: int | None) -> str:
    times = "once" if wanted["repeats"] == 1 else f"{wanted['repeats']} times"
    said = (
        f"Drop next, {times}: {wanted['sphere']} on {wanted['surface']} from "
        f"{1e3 * wanted['drop_height_m']:.1f} mm; it distinguishes "
        f"{' from '.join(wanted['separates'])} (one drop separates them by "
        f"{wanted['expected_distance']:.1f} noise units)."
    )
    if number is None:
        return said
    return f"{said}\nThe daemon makes it: impactd drop --proposed-by {number}"
