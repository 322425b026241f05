"""``impactd calibrate``: a run of drops, or weights as somebody read them."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from analysis.written_numbers import counted, measured
from impactd.client.connection import Connection
from impactd.client.talk import fresh_key
from impactd.console.client import connect
from impactd.console.drops import hang_words
from impactd.console.failure import Failure
from impactd.console.progress_bar import progress, tell
from impactd.console.tables import print_json


def run(*, slot: str | None, unattended: bool, wait: bool, url: str | None, as_json: bool) -> None:
    """Ask for a calibration run and print what became of it.

    Parameters
    ----------
    slot : str or None
        The timer's slot; ``None`` runs in any case.
    unattended : bool
        Whether nobody stands by the rig.
    wait : bool
        Whether to wait for the end.

    Raises
    ------
    Failure
        If the run failed.
    """
    body = {"slot": slot, "unattended": unattended}
    with connect(url) as client:
        calibration = client.send("POST", "/v1/calibrations", body, key=slot or fresh_key())
        number = calibration["number"]
        if wait:
            calibration = _watch(client, number)
    if as_json:
        print_json(calibration)
    else:
        print(_told(calibration))
    if calibration["state"] == "failed":
        problem: dict[str, Any] = calibration["problem"] or {"detail": "no reason", "remedy": ""}
        raise Failure(f"calibration {number}: {problem['detail']} {problem['remedy']}".strip())


def _watch(client: Connection, number: int) -> dict[str, Any]:
    """Return a run once it has ended; say meanwhile which sphere to hang, and how many are left."""
    said = -1

    def follow(state: str, share: float | None) -> None:
        """Tell each new drop once, and move the bar."""
        nonlocal said
        series = client.get("/v1/status").get("series")
        if state != "running" or not series or series["number"] != number:
            progress(f"calibration {number}: {state}", share=share)
            return
        done, of = series["done"], series["of"]
        if done != said:
            said = done
            tell(next_drop(series), in_a_pipe=True)
        progress(f"calibration {number}: drop {done + 1} of {of}", share=done / of)

    try:
        return client.wait(
            f"/v1/calibrations/{number}",
            lambda answer: answer["state"] in ("done", "failed"),
            follow,
        )
    except KeyboardInterrupt:
        raise Failure(
            f"calibration {number} continues without this command; `impactd abort` ends it."
        ) from None
    finally:
        progress("", last=True)


def next_drop(series: dict[str, Any]) -> str:
    """Return which sphere to hang now, as how many of how many, and how long it takes yet."""
    wanted = series["next"]
    left = series.get("remaining_s")
    words = hang_words(wanted["sphere"], wanted["surface"], wanted["drop_height_m"])
    about = "" if left is None else f" (about {left:.0f} s left)"
    return f"Drop {series['done'] + 1} of {series['of']}: {words}{about}."


def weights(
    path: Path,
    *,
    hold_time_s: float,
    discharge_time_constant_s: float | None,
    url: str | None,
    as_json: bool,
) -> None:
    """Send weights and readings and print the gain they give.

    Parameters
    ----------
    path : Path
        CSV with the columns ``mass_kg``, ``volts`` and, where known, ``u_volts``.
    hold_time_s : float
        From putting a weight down to its reading. [s]
    discharge_time_constant_s : float or None
        Of cell and conditioner. [s]

    Raises
    ------
    Failure
        If the file is no such table.
    """
    body = {
        "method": "static_weights",
        "readings": readings_of(path),
        "hold_time_s": hold_time_s,
        "discharge_time_constant_s": discharge_time_constant_s,
    }
    with connect(url) as client:
        calibration = client.send("POST", "/v1/calibrations", body, key=fresh_key())
    if as_json:
        print_json(calibration)
        return
    result = calibration["result"]
    gain = measured(result["as_read"]["gain_N_per_V"])
    print(f"Calibration {calibration['number']}, weights: S = {gain} N/V as read (95 %).")
    for line in (*result["warnings"], (result.get("against") or {}).get("sentence")):
        if line:
            print(line)


def readings_of(path: Path) -> list[dict[str, float]]:
    """Return the readings of a CSV file.

    Parameters
    ----------
    path : Path
        With a header line.

    Returns
    -------
    list of dict
        As ``POST /v1/calibrations`` takes them.

    Raises
    ------
    Failure
        With line and column of what is no number.
    """
    with path.open(newline="", encoding="utf-8-sig") as file:
        table = csv.DictReader(file)
        columns = [name.strip() for name in table.fieldnames or ()]
        table.fieldnames = columns
        if not {"mass_kg", "volts"} <= set(columns) <= {"mass_kg", "volts", "u_volts"}:
            raise Failure(
                f"{path}: the columns are {', '.join(columns) or 'none'}; they must be mass_kg, "
                "volts and, where known, u_volts."
            )
        found = []
        for row in table:
            try:
                found.append({name: float(row[name]) for name in columns if row[name].strip()})
            except (TypeError, ValueError, AttributeError) as error:
                raise Failure(f"{path}, line {table.line_num}: {row} is no reading.") from error
    return found


def _told(calibration: dict[str, Any]) -> str:
    count = len(calibration["drops"])
    drops = counted(count, "drop")
    told = f"Calibration {calibration['number']} is {calibration['state']}, {drops} so far."
    if calibration["state"] == "failed":
        told = f"Calibration {calibration['number']} ended after {drops}."
    if calibration["state"] == "done":
        told = (
            f"Calibration {calibration['number']} is done after {drops}, valid until "
            f"{calibration['valid_until_utc'][:10]}."
        )
    return told
