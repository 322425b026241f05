"""``impactd new``: asks on a terminal, and shows what came of it."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import typer

from impactd.console.tables import print_json, table, wrapped
from impactd.importing.choices import Ask, Choices, propose
from impactd.importing.new_campaign import Made, make_campaign, remark
from impactd.importing.readers import split_inside

_SHOWN = 30
"""Shots in the table; the rest is in campaign.json."""
_UNITS = {"voltage": "V", "force_N": "N", "acceleration_m_per_s2": "m/s^2"}


def run(
    files: Sequence[str], out: Path | None, choices: Choices, *, yes: bool, as_json: bool
) -> None:
    """Make a campaign folder and show it.

    Parameters
    ----------
    out : Path or None
        The folder; ``None`` is named after the first file, here.
    yes : bool
        Whether nothing is asked.
    as_json : bool
        Whether the answer is JSON.
    """
    folder = out or Path(f"{split_inside(files[0])[0].stem}-campaign")
    made = make_campaign(files, folder, choices, propose if yes else _asker())
    if as_json:
        print_json(_document(made))
    else:
        print(_summary(made))


def _asker() -> Ask:
    """Return who answers questions: a person on a terminal, nobody in a pipe."""
    return _ask if sys.stdin.isatty() and sys.stderr.isatty() else propose


def _ask(question: str, answers: Sequence[str], proposal: str) -> str:
    while True:
        listed = f" ({', '.join(answers)})" if answers else ""
        answer: str = typer.prompt(question + listed, default=proposal or None, err=True)
        if not answers or answer in answers:
            return answer
        typer.echo(f"{answer!r} is none of them.", err=True)


def _document(made: Made) -> dict[str, object]:
    return {
        "campaign": str(made.path),
        "picture": str(made.picture),
        "assumptions": list(made.said),
        "shots": made.shots_to_json(),
    }


def _summary(made: Made) -> str:
    rows = [
        (
            at,
            one.name,
            f"{one.begins_s:.6g}",
            f"{one.hit.peak:.4g}",
            f"{one.contact_s * 1e3:.3g}",
            one.trigger_index,
            one.samples.size,
            remark(one),
        )
        for at, one in enumerate(made.shots[:_SHOWN])
    ]
    unit = _UNITS[made.shots[0].unit.quantity]
    head = (
        "shot", "name", "begins / s", f"peak / {unit}", "contact / ms", "trigger_index", "samples",
        "",
    )  # fmt: skip
    parts = [
        "Read and assumed:\n" + "\n".join(wrapped(one, "- ") for one in made.said),
        table(head, rows),
    ]
    if len(made.shots) > _SHOWN:
        parts.append(f"... and {len(made.shots) - _SHOWN} more.")
    path = shlex.quote(str(made.path))
    parts.append(
        f"Written: {made.path}; shots: {len(made.shots)}.\n"
        f"Look at {made.picture}: is each grey band one hit?\n"
        f"Then: impactd fit {path}\n"
        f"and: impactd diagnose {path} --report diagnosis.html"
    )
    return "\n\n".join(parts)
