"""The steps of the demo, one after another."""

from __future__ import annotations

import json
import secrets
import shutil
import time
from dataclasses import replace
from pathlib import Path

from rich.console import Console
from rich.table import Table

from drivers.simulated.truth import unseal
from impactd.console.failure import Failure
from impactd.demo import drops
from impactd.demo.outcome import Outcome, Row, compare
from impactd.demo.report import gigapascals, inside, true_gigapascals
from impactd.demo.rig_process import RigProcess, write_settings
from impactd.settings import load_settings
from impactd.simulated_rig import SEALED_NAME
from impactd.storage.archive import Archive
from impactd.storage.campaign_folder import read_campaign

_SETTINGS, _DATA, _SHOTS, _LOG = "rig.toml", "archive", "shots", "daemon.log"
_RESULTS = ("moduli.json", "truth.json", "report.html", "trace.png", "moduli.png")
_WIDTH_IN_A_PIPE = 110


def run_demo(*, out: Path, seed: int | None = None, effect: str = "none") -> int:
    """Do the main job in one go on the simulated rig.

    Parameters
    ----------
    out : Path
        Folder for everything that is left behind. An earlier demo there is replaced.
    seed : int, optional
        Of everything the simulated rig draws; without it, a fresh one that is printed.
    effect : str
        What the instrument hides: an effect's id, ``random`` or ``none``.

    Returns
    -------
    int
        0; anything that goes wrong is raised.

    Raises
    ------
    Failure
        In one sentence.
    """
    began = time.monotonic()
    console = Console()
    if not console.is_terminal:
        console = Console(width=_WIDTH_IN_A_PIPE)
    seed = secrets.randbelow(10_000) if seed is None else seed
    _make_room(out)
    settings = out / _SETTINGS
    write_settings(settings, seed=seed, effect=effect)

    console.print(f"Simulated rig, seed {seed}; all that follows goes through its daemon.")
    with RigProcess(settings, out / _DATA, out / _LOG) as rig:
        with console.status("starting the daemon ..."):
            client = rig.connect()
        with client:
            console.print("\nCalibration of the load cell, with reference spheres:")
            calibration = drops.calibrate(client, console)
            console.print("\nCampaign:")
            shots = drops.drop_all(client, console)
            fits = {
                model: drops.fit_together(client, shots, model, console) for model in ("hsd", "kv")
            }
            # Here the loop is to be closed: POST /v1/diagnoses with these shots, then its report.

    truth = unseal(out / _DATA / SEALED_NAME)
    outcome = compare(fits["hsd"], fits["kv"], calibration, truth, seed)
    _leave_results(out, outcome, [shot["number"] for shot in shots])
    _show(console, outcome)
    console.print(f"\n{outcome.sentence()}", highlight=False)
    took_s = time.monotonic() - began
    console.print(f"{took_s:.0f} s. Look at {out / 'report.html'}", highlight=False)
    return 0


def _make_room(out: Path) -> None:
    """Remove an earlier demo, and only that."""
    ours = {_SETTINGS, _DATA, _SHOTS, _LOG, *_RESULTS}
    there = {path.name for path in out.iterdir()} if out.is_dir() else set()
    strange = sorted(there - ours)
    if strange:
        raise Failure(
            f"{out} holds things that no demo left there ({', '.join(strange[:3])}); "
            "name another folder with --out."
        )
    for name in there:
        path = out / name
        if path.is_dir():
            shutil.rmtree(path)
        else:
            path.unlink()
    out.mkdir(parents=True, exist_ok=True)


def _leave_results(out: Path, outcome: Outcome, numbers: list[int]) -> None:
    """Write shots, moduli, truth, pictures and the page."""
    # matplotlib takes half a second to come; nobody waits for it before the first drop
    from impactd.demo.figures import draw_moduli, draw_trace  # noqa: PLC0415
    from impactd.demo.report import write_report  # noqa: PLC0415

    settings = load_settings(out / _SETTINGS, data=out / _DATA)
    with Archive.open(
        settings.storage.directory, reserve_bytes=settings.storage.reserve_bytes
    ) as archive:
        archive.export(numbers, "campaign", out / _SHOTS)
    for name, content in (("moduli.json", outcome.to_json()), ("truth.json", outcome.truth)):
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
    draw_trace(pictures["trace"], replace(campaign, shots=(shot,)), title)
    draw_moduli(pictures["moduli"], outcome)
    write_report(out / "report.html", outcome, pictures)


def _show(console: Console, outcome: Outcome) -> None:
    """Print both tables."""
    for what, title, rows in (
        ("pair", "Reduced modulus E* (u: standard uncertainty)", outcome.pairs),
        ("material", "Young's modulus E", outcome.materials),
    ):
        table = Table(title=title, title_justify="left", title_style="bold", box=None)
        table.add_column(what, no_wrap=True)
        for heading in ("shots", "HSD ± u / GPa", "KV ± u / GPa", "truth / GPa"):
            table.add_column(heading, justify="right", no_wrap=True)
        table.add_column("in KV's 95 %?")
        for row in rows:
            table.add_row(*_cells(row))
        console.print()
        console.print(table)


def _cells(row: Row) -> list[str]:
    return [
        row.name + (" (known before)" if row.known else ""),
        str(row.shots),
        gigapascals(row.hsd),
        gigapascals(row.kv),
        true_gigapascals(row),
        inside(row.kv, row.truth_pa),
    ]
