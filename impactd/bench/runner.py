"""Runs the benchmarks one after another, prints a table, writes JSON."""

from __future__ import annotations

import importlib
import json
import os
import platform
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

from impactd import __version__
from impactd.bench.figure import Figure

BENCHMARKS = ("solver", "stream", "store", "fit_speed", "scale")
"""Modules of this package, in the order they run; each has ``measure() -> list[Figure]``."""
LONG = ("refit", "study", "readers", "coverage", "blind")
"""Benchmarks of minutes, which run when they are named."""

_WIDTH_IN_A_PIPE = 120


def run(json_out: Path | None, only: list[str] | None = None) -> int:
    """Run benchmarks and print each figure as a ratio to its reference.

    Parameters
    ----------
    json_out : Path or None
        File that gets the figures as ``impactd-bench/1``; ``-`` prints them instead of the table.
    only : list of str, optional
        Names out of `BENCHMARKS` and `LONG`; those of `BENCHMARKS` by default.

    Returns
    -------
    int
        Exit code: 0 when every benchmark ran (a missed goal is shown, not punished: machines
        differ), 1 when one could not, 2 for an unknown name.
    """
    console = _console()
    names = list(only or BENCHMARKS)
    known = (*BENCHMARKS, *LONG)
    unknown = [name for name in names if name not in known]
    if unknown:
        print(
            f"No benchmark is called {', '.join(unknown)}; there are {', '.join(known)}.",
            file=sys.stderr,
        )
        return 2
    figures: dict[str, list[Figure]] = {}
    failed = False
    for name in names:
        if console.is_terminal and json_out != Path("-"):
            console.print(f"[dim]{name} ...[/dim]")
        try:
            figures[name] = importlib.import_module(f"impactd.bench.{name}").measure()
        except Exception as error:  # one broken benchmark must not hide the others
            print(f"The benchmark '{name}' could not run: {error}", file=sys.stderr)
            failed = True
    document = json.dumps(_document(figures), indent=2)
    if json_out == Path("-"):
        print(document)
    else:
        console.print(_table(figures))
        if json_out is not None:
            json_out.write_text(document + "\n")
    return 1 if failed else 0


def show(figures: dict[str, list[Figure]]) -> None:
    """Print figures as the table of `run`."""
    _console().print(_table(figures))


def _console() -> Console:
    console = Console()
    return console if console.is_terminal else Console(width=_WIDTH_IN_A_PIPE)


def _table(figures: dict[str, list[Figure]]) -> Table:
    """Lay the figures out."""
    table = Table("figure", "measured", "reference", "ratio", "goal", "", box=None)
    for rows in figures.values():
        for figure in rows:
            reference = (
                ""
                if figure.reference is None
                else f"{_readable(figure.reference, figure.unit)}  {figure.reference_name}"
            )
            table.add_row(
                figure.name,
                _readable(figure.value, figure.unit),
                reference,
                "" if figure.ratio is None else f"{figure.ratio:.3g}",
                figure.goal,
                {None: "", True: "met", False: "MISSED"}[figure.met],
            )
    return table


def _readable(value: float, unit: str) -> str:
    """Write a number the way people say it: seconds as us or ms, rates as M or k."""
    if unit == "1":
        return f"{value:.3g}"
    steps = {"s": (("s", 1.0), ("ms", 1e-3), ("us", 1e-6))}.get(
        unit, ((f"M{unit}", 1e6), (f"k{unit}", 1e3), (unit, 1.0))
    )
    for name, size in steps:
        if abs(value) >= size:
            return f"{value / size:.3g} {name}"
    name, size = steps[-1]
    return f"{value / size:.3g} {name}"


def _document(figures: dict[str, list[Figure]]) -> dict[str, object]:
    """Gather what another machine's figures can be laid beside."""
    return {
        "format": "impactd-bench/1",
        "software": f"impactd {__version__}",
        "python": platform.python_version(),
        "machine": platform.machine(),
        "cpus": os.cpu_count(),
        "figures": {name: [figure.to_json() for figure in rows] for name, rows in figures.items()},
    }
