"""`impactd paper`: compute, print, and leave page, pictures and JSON."""

from __future__ import annotations

import json
import time
from collections.abc import Collection
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from impactd.console.failure import Failure
from impactd.console.tables import print_json
from impactd.paper.compute import PaperResult, compute
from impactd.paper.page import PAIR_HEADINGS, gigapascals, page, pair_rows, table_3_rows
from impactd.paper.printed_rows import ROW_HEADINGS, TABLES, row_texts
from impactd.paper.trace_page import CLOSED_HEADINGS, closed_rows
from impactd.paper.turn_page import LADDER_HEADINGS, ladder_rows, moduli_headings, moduli_rows

PAGE_NAME, JSON_NAME, PICTURES = "paper.md", "paper.json", "pictures"
_WIDTH_IN_A_PIPE = 150


def run_paper(
    *,
    out: Path,
    rigs: int,
    seed: int,
    as_json: bool,
    turn_pairs: Collection[tuple[str, str]] | None = None,
) -> None:
    """Compute everything, print it and write it.

    Parameters
    ----------
    out : Path
        Folder for page, pictures and JSON; created if need be, files of the same names replaced.
    rigs, seed : int
        Simulated rigs, and the first one's seed.
    as_json : bool
        Print the JSON instead of tables.
    turn_pairs : collection of tuple, optional
        (sphere, surface) of the loop's turns; all of Table 5 without it.

    Raises
    ------
    Failure
        With fewer than two rigs: there would be no spread.
    """
    if rigs < 2:
        raise Failure(
            f"a spread needs at least 2 simulated rigs, not {rigs}; give --rigs 2 or more."
        )
    # matplotlib takes half a second to come
    from impactd.paper.pictures import draw_all  # noqa: PLC0415

    began = time.monotonic()
    console = Console(stderr=as_json)
    if not console.is_terminal:
        console = Console(stderr=as_json, width=_WIDTH_IN_A_PIPE)
    out.mkdir(parents=True, exist_ok=True)
    with console.status("figures 2-6") as status:
        result = compute(rigs, seed, status.update, turn_pairs)
    found = result.to_json()
    (out / JSON_NAME).write_text(
        json.dumps(found, indent=1, allow_nan=False, ensure_ascii=False) + "\n", encoding="utf-8"
    )
    command = f"impactd paper --out {out} --rigs {rigs} --seed {seed}"
    (out / PAGE_NAME).write_text(page(result, command), encoding="utf-8")
    draw_all(out / PICTURES, result.rigs, result.valley)
    if as_json:
        print_json(found)
    else:
        _show(console, result)
    took_s = time.monotonic() - began
    console.print(f"\n{took_s:.0f} s. Look at {out / PAGE_NAME}", highlight=False)


def _show(console: Console, result: PaperResult) -> None:
    found = result.to_json()
    _show_tables(console, result, found)
    for turn in result.turns:
        _print_table(
            console,
            f"The loop from HSD, undeclared: {turn.undeclared or 'nothing'}; "
            f"found: {', '.join(turn.found) or 'nothing'}",
            LADDER_HEADINGS,
            ladder_rows(turn),
        )
        headings = moduli_headings(turn, with_paper=True)
        _print_table(console, "", tuple(headings), moduli_rows(turn, with_paper=True))
    valley = found["valley"]
    ends = ", ".join(
        f"{gigapascals(f['sphere_Pa'])}/{gigapascals(f['surface_Pa'])}" for f in valley["fits"]
    )
    console.print(
        f"\nOne pair ({valley['pair']}), E_p/E_s in GPa by start: {ends}; E* always "
        f"{valley['fits'][0]['reduced_modulus_Pa'] / 1e9:.3f}. Correlation "
        f"{valley['correlation_ln_moduli']:.6f}: the split is not in the data.",
        highlight=False,
    )


def _show_tables(console: Console, result: PaperResult, found: dict[str, Any]) -> None:
    rigs = f"{found['rigs']} simulated rigs"
    for title, claims in (
        ("Text and figures", result.claims),
        (f"Tables 3-5 as wholes, {rigs}", result.table_claims()),
    ):
        rows = [[c.where, c.says, c.claimed, c.ours, c.verdict] for c in claims]
        _print_table(console, title, ("where", "claim", "claimed", "ours", "verdict"), rows)
    _print_table(
        console,
        "A closed rig, read with KV and with kv2",
        CLOSED_HEADINGS,
        closed_rows(found["closed_model"]),
    )
    _print_table(
        console,
        f"Table 3, {rigs}",
        ("quantity", "paper", "rigs as drawn", "calibrated", "rms error"),
        table_3_rows(found["table3"]),
    )
    _print_table(
        console,
        "Tables 4 and 5: E* over literature (paper) or truth (ours)",
        PAIR_HEADINGS,
        pair_rows(found["tables_4_5"]),
    )
    for table, model in TABLES.items():
        title = f"Table {table[5]} as printed ({model}), GPa"
        _print_table(console, title, ROW_HEADINGS, row_texts(result.printed, table))


def _print_table(
    console: Console, title: str, headings: tuple[str, ...], rows: list[list[str]]
) -> None:
    table = Table(title=title, title_justify="left", title_style="bold", box=None)
    for heading in headings:
        table.add_column(heading)
    for row in rows:
        style = "red" if "does not hold" in row else None
        table.add_row(*row, style=style)
    console.print()
    console.print(table)
