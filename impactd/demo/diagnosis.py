"""A diagnosis over HTTP, with its progress; the model that it accepted is made active."""

from __future__ import annotations

import time
from pathlib import Path

from rich.console import Console

from analysis.base_models import DEFAULT_BASE
from impactd.aliases import Json
from impactd.client.connection import Connection
from impactd.client.talk import fresh_key
from impactd.console.failure import Failure
from impactd.demo.drops import until

SEARCH_S = 45.0
"""How long a diagnosis may search here. A choice: a soft tape, which takes the longest of what was
drawn so far, was found after 30 s on one core, and a search has 0.8 of this; drops, fits and pages
take twice as long themselves."""
_DIAGNOSIS_LIMIT_S = 600.0
"""When a diagnosis that does not end is given up: beside ten other programs it takes ten times
as long."""
_ENDED = ("done", "failed", "cancelled")


def diagnose(client: Connection, shots: list[int], console: Console, page: Path) -> Json:
    """Have the daemon find out what KV misses on these shots.

    Parameters
    ----------
    client : Connection
        Connected to the daemon.
    shots : list of int
        Numbers: the calibration's drops and the campaign's.
    console : Console
        Where to show how far it is.
    page : Path
        Where the diagnosis' own report goes.

    Returns
    -------
    dict
        The diagnosis as the API gives it; ``result`` is ``impactd-diagnosis/1``.

    Raises
    ------
    Failure
        If it failed or does not end.
    """
    began = time.monotonic()
    asked = {"shots": shots, "base": DEFAULT_BASE, "budget_s": SEARCH_S}
    job = client.send("POST", "/v1/diagnoses", asked, key=fresh_key())
    with console.status(f"diagnosing {len(shots)} drops ...") as status:
        for answer in until(client, f"/v1/diagnoses/{job['id']}", _ENDED, _DIAGNOSIS_LIMIT_S):
            job = answer
            if job["progress"]:
                share = f" {100 * job['progress']['share']:.0f} %"
                status.update(f"diagnosing {len(shots)} drops: {job['progress']['text']}{share}")
    if job["state"] != "done":
        raise Failure(f"the diagnosis {job['state']}: {job['reason']}")
    client.download(f"/v1/diagnoses/{job['id']}/report.html", page)
    took_s = time.monotonic() - began
    console.print(
        f"\nDiagnosis of all {len(shots)} drops: {took_s:.0f} s, with its fits and its report",
        highlight=False,
    )
    return job


def activate(client: Connection, diagnosis: Json) -> str | None:
    """Make the accepted model the one that later fits use.

    Returns
    -------
    str or None
        The model with its version; ``None`` where none was accepted.
    """
    model = diagnosis["model"]
    if model is None:
        return None
    client.send("PUT", "/v1/models/active", model)
    return f"{model['name']} version {model['version']}"
