"""``impactd calibrate``: ask for a run, and wait for it where the timer needs its outcome."""

from __future__ import annotations

from typing import Any

from impactd.console.client import connect, fresh_key
from impactd.console.failure import Failure
from impactd.console.tables import print_json, progress


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
    url : str or None
        The daemon.
    as_json : bool
        Print the answer.

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
            calibration = client.wait(
                f"/v1/calibrations/{number}",
                lambda answer: answer["state"] in ("done", "failed"),
                lambda state: progress(f"calibration {number}: {state}"),
            )
            progress("", last=True)
    if as_json:
        print_json(calibration)
    else:
        print(_told(calibration))
    if calibration["state"] == "failed":
        problem: dict[str, Any] = calibration["problem"] or {"detail": "no reason", "remedy": ""}
        raise Failure(f"calibration {number}: {problem['detail']} {problem['remedy']}".strip())


def _told(calibration: dict[str, Any]) -> str:
    count = len(calibration["drops"])
    told = f"Calibration {calibration['number']} is {calibration['state']}, {count} drops so far."
    if calibration["state"] == "done":
        told = (
            f"Calibration {calibration['number']} is done after {count} drops, valid until "
            f"{calibration['valid_until_utc']}."
        )
    return told
