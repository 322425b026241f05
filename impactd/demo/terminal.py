"""What the demo prints, but for the drops themselves."""

from __future__ import annotations

from rich.console import Console
from rich.table import Table

from analysis.written_numbers import measured
from impactd.aliases import Json
from impactd.demo.judgement import truth_line
from impactd.demo.outcome import CLOSED, Outcome
from impactd.demo.words import gigapascals, inside, off_by, true_gigapascals
from impactd.diagnosis.repair import MEAN_WAVEFORM


def say_what_runs(console: Console, seed: int, effect: str) -> None:
    """Print what is about to happen."""
    console.print(f"Simulated rig, seed {seed}; all that follows goes through its daemon.")
    if effect == "random":
        console.print(
            "The rig has an effect that the closed KV lacks. It is drawn at random and sealed."
        )
    elif effect != "none":
        console.print(f"The rig hides {effect}; neither daemon nor diagnosis is told.")


def say_what_was_found(console: Console, found: Json) -> None:
    """Print the residual's description, the verdict and the numbers of the named effects.

    Parameters
    ----------
    found : dict
        ``impactd-diagnosis/1``.
    """
    heading(console, "What was seen in the residual of the closed KV")
    for line in found["residual"]["before"]["said"]:
        console.print(f"  {line}", highlight=False)
    heading(console, "Verdict")
    console.print(f"  {found['verdict'].upper()}. {found['sentence']}", highlight=False)
    for effect in found["effects"]:
        for name, value in effect["parameters"].items():
            said = measured(value, sign="±")
            console.print(
                f"  {effect['id']}: {name} = {said} {value['unit']} (95 %)", highlight=False
            )
        if effect["confusable_with"]:
            others = ", ".join(effect["confusable_with"])
            console.print(f"  These drops cannot distinguish it from: {others}.", highlight=False)
    if found["next_drop"]:
        console.print(f"  {next_drop_line(found['next_drop'])}", highlight=False)


def next_drop_line(wanted: Json) -> str:
    """Return which drop would tell most.

    Parameters
    ----------
    wanted : dict
        ``next_drop`` of a diagnosis.
    """
    apart = " from ".join(wanted.get("separates") or [])
    return (
        f"Drop next: {wanted['sphere']} on {wanted['surface']} from "
        f"{wanted['drop_height_m'] * 1e3:.0f} mm"
        + ((f"; it would distinguish {apart}.") if apart else ".")
    )


def say_what_is_active(console: Console, model: str | None) -> None:
    """Print which model later fits use."""
    if model is not None:
        console.print(f"  Made the active model: {model}.", highlight=False)


def show(console: Console, outcome: Outcome) -> None:
    """Print the moduli of all pairs, the ladder, the sealed truth and the judgement."""
    _show_pairs(console, outcome)
    _show_ladder(console, outcome)
    heading(console, "The sealed truth")
    effects = outcome.truth.get("effects") or []
    for line in [truth_line(effect) for effect in effects] or [
        "No effect acted that the closed KV lacks."
    ]:
        console.print(f"  {line}", highlight=False)
    judgement = outcome.judgement
    console.print(f"  {judgement.word}: {judgement.sentence}", highlight=False)


def _show_pairs(console: Console, outcome: Outcome) -> None:
    table = _table("Reduced modulus E* of each pair / GPa (± U, 95 %)", "pair")
    shown = [rung for rung in outcome.rungs if rung.key != "kv"]  # as many as a terminal holds
    for rung in shown:
        table.add_column(_short(rung.key), justify="right", no_wrap=True)
    table.add_column("truth", justify="right", no_wrap=True)
    table.add_column("in 95 %?", no_wrap=True)
    for row in outcome.pairs:
        table.add_row(
            row.name,
            *(gigapascals(row.estimates[rung.key]) for rung in shown),
            true_gigapascals(row.truth_pa, row.estimates.values()),
            inside(row.estimates[outcome.last.key], row.truth_pa),
        )
    console.print()
    console.print(table)


def _show_ladder(console: Console, outcome: Outcome) -> None:
    noise_mv = 1e3 * float(outcome.diagnosis["noise_rms_V"])
    title = f"The models: error on held-out drops (noise: {noise_mv:.3g} mV) and specimen"
    table = _table(title, "model")
    for name in ("error / mV", "E/(1-ν²) ± U / GPa", "truth", "off by"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("in 95 %?", no_wrap=True)
    table.add_column("pairs", no_wrap=True)
    truth_pa = outcome.specimen_truth_pa
    true = true_gigapascals(truth_pa, (rung.specimen for rung in outcome.rungs))
    for rung in outcome.rungs:
        held, found = rung.heldout_rms_v, rung.specimen
        holds, stated = outcome.held(rung.key)
        table.add_row(
            rung.name,
            "-" if held is None else f"{1e3 * held:.4g}",
            gigapascals(found),
            true,
            off_by(found, truth_pa),
            inside(found, truth_pa),
            f"{holds} of {stated}" if stated else "-",
        )
    mean = outcome.mean_waveform_rms_v
    if mean is not None:
        table.add_row(MEAN_WAVEFORM, f"{1e3 * mean:.4g}", *["-"] * 5)
    console.print()
    console.print(table)


def heading(console: Console, words: str) -> None:
    """Print a heading after an empty line."""
    console.print()
    console.print(words, style="bold", highlight=False)


def _short(key: str) -> str:
    return {"hsd": "HSD", "kv": "KV", "kv2": CLOSED, "after": "+ found"}[key]


def _table(title: str, first: str) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold", box=None)
    table.add_column(first, no_wrap=True)
    return table
