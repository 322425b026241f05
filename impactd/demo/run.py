"""The steps of the demo, one after another."""

from __future__ import annotations

import json
import secrets
import shutil
import time
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from drivers.simulated.truth import unseal
from impactd.console.failure import Failure
from impactd.demo import diagnosis, drops, terminal
from impactd.demo.outcome import Outcome, compare
from impactd.demo.rig_process import MATERIALS_NAME, RigProcess, write_settings
from impactd.rig.simulated import SEALED_NAME, check_effect
from impactd.settings.settings import load_settings
from impactd.storage.archive import Archive
from impactd.storage.campaign_folder import read_campaign

_SETTINGS, _DATA, _SHOTS, _LOG, _DIAGNOSIS = (
    "rig.toml", "archive", "shots", "daemon.log", "diagnosis.html"
)  # fmt: skip
_RESULTS = (
    "moduli.json", "diagnosis.json", "truth.json", "report.html", "trace.png", "moduli.png"
)  # fmt: skip
_WIDTH_IN_A_PIPE = 110


def run_demo(
    *, out: Path, seed: int | None = None, effect: str = "random", as_json: bool = False
) -> int:
    """Do the main job in one go on the simulated rig.

    Parameters
    ----------
    out : Path
        Folder for everything that is left behind. An earlier demo there is replaced.
    seed : int, optional
        Of everything the simulated rig draws; without it, a fresh one that is printed.
    effect : str
        What the instrument hides from the first drop on: an effect's id, ``random`` (one in four
        from outside the library) or ``none``.
    as_json : bool, optional
        Print ``moduli.json`` on standard output in the end; the story goes to standard error.

    Returns
    -------
    int
        0; anything that goes wrong is raised. A verdict that is not right is no failure.

    Raises
    ------
    Failure
        In one sentence.
    """
    began = time.monotonic()
    console = Console(stderr=as_json)
    if not console.is_terminal:
        console = Console(stderr=as_json, width=_WIDTH_IN_A_PIPE)
    seed = secrets.randbelow(10_000) if seed is None else seed
    check_effect(effect)
    _make_room(out)
    settings = out / _SETTINGS
    write_settings(settings, seed=seed, effect=effect)

    range_v = load_settings(settings, data=out / _DATA).digitizer.range_v
    terminal.say_what_runs(console, seed, effect)
    with RigProcess(settings, out / _DATA, out / _LOG) as rig:
        with console.status("starting the daemon ..."):
            client = rig.connect()
        with client:
            console.print("\nCalibration of the load cell, with reference spheres:")
            calibration = drops.calibrate(client, console)
            console.print(
                "\nCampaign (reduced modulus E* ± U, 95 %; time until it was there; advice):"
            )
            drops.drop_all(client, console, range_v=range_v)
            # The reference drops belong to it: the calibration was made under the model in doubt.
            numbers = sorted(
                shot["number"]
                for shot in client.pages("/v1/shots", drops.MOST_SHOTS)
                if not drops.overloaded(shot, range_v)
            )
            fits = {
                model: drops.fit_together(client, numbers, model, console)
                for model in ("hsd", "kv")
            }
            found = diagnosis.diagnose(client, numbers, console, out / _DIAGNOSIS)
            terminal.say_what_was_found(console, found["result"])
            model = diagnosis.activate(client, found)
            terminal.say_what_is_active(console, model)

    truth = unseal(out / _DATA / SEALED_NAME)
    outcome = compare(fits, found["result"], calibration, truth, seed=seed, model=model)
    _leave_results(out, outcome, numbers)
    terminal.show(console, outcome)
    took_s = time.monotonic() - began
    console.print(f"\n{took_s:.0f} s. Look at {out / 'report.html'}", highlight=False)
    if as_json:
        print((out / "moduli.json").read_text(encoding="utf-8"), end="")
    return 0


def _make_room(out: Path) -> None:
    """Remove an earlier demo, and only that."""
    ours = {_SETTINGS, MATERIALS_NAME, _DATA, _SHOTS, _LOG, _DIAGNOSIS, *_RESULTS}
    there = {path.name for path in out.iterdir()} if out.is_dir() else set()
    strange = sorted(there - ours)
    if strange:
        raise Failure(
            f"{out} holds files that are not from a demo ({', '.join(strange[:3])}); name another "
            "folder with --out."
        )
    for name in there:
        path = out / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    out.mkdir(parents=True, exist_ok=True)


def _leave_results(out: Path, outcome: Outcome, numbers: list[int]) -> None:
    """Write shots, moduli, diagnosis, truth, pictures and the page."""
    # matplotlib takes half a second to come; nobody waits for it before the first drop
    from impactd.demo.figures import draw_moduli, draw_trace  # noqa: PLC0415
    from impactd.demo.report import write_report  # noqa: PLC0415

    settings = load_settings(out / _SETTINGS, data=out / _DATA)
    with Archive.open(
        settings.storage.directory, reserve_bytes=settings.storage.reserve_bytes
    ) as archive:
        archive.export(numbers, "campaign", out / _SHOTS)
    for name, content in (
        ("moduli.json", outcome.to_json()),
        ("diagnosis.json", outcome.diagnosis),
        ("truth.json", outcome.truth),
    ):
        text = json.dumps(content, indent=1, allow_nan=False, ensure_ascii=False)
        (out / name).write_text(text + "\n", encoding="utf-8")
    campaign = read_campaign(out / _SHOTS)
    shot = max(
        (shot for shot in campaign.shots if (shot.sphere, shot.surface) == ("acetal", "specimen")),
        key=lambda shot: shot.drop_height_m or 0.0,
    )
    pictures = {"trace": out / "trace.png", "moduli": out / "moduli.png"}
    height_mm = (shot.drop_height_m or 0.0) * 1e3
    title = f"{shot.sphere} on {shot.surface}, dropped from {height_mm:g} mm"
    draw_trace(pictures["trace"], replace(campaign, shots=(shot,)), outcome, title)
    draw_moduli(pictures["moduli"], outcome)
    write_report(out / "report.html", outcome, pictures)
