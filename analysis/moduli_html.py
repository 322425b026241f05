"""Moduli as a small table of HTML, which a notebook shows in place of a repr."""

from __future__ import annotations

from html import escape

from analysis.aliases import Json
from analysis.written_numbers import K_95, measured

_HEAD = ("material", "status", "E ± U / GPa", "E/(1-ν²) ± U / GPa", "")


def moduli_html(model: str, outcome: str, moduli: Json) -> str:
    """Return the table.

    Parameters
    ----------
    outcome : str
        How the fit ended, in words.
    moduli : dict
        By material, as in ``impactd-fit/1``.
    """
    rows = [
        (
            name,
            entry["status"],
            measured(entry["youngs_modulus_Pa"], scale=1e-9, sign="±"),
            measured(entry["plane_strain_modulus_Pa"], scale=1e-9, sign="±"),
            entry.get("reason") or _stated(entry),
        )
        for name, entry in moduli.items()
    ]
    if not rows:
        return f"<p><b>{escape(model)}</b>: {escape(outcome)} There is no modulus.</p>"
    caption = f"<b>{escape(model)}</b>: {escape(outcome)} U = k u, k = {K_95:.3g} (95 %)"
    return (
        f"<table><caption>{caption}</caption><thead>{_row(_HEAD, 'th')}</thead>"
        f"<tbody>{''.join(_row(row, 'td') for row in rows)}</tbody></table>"
    )


def _stated(entry: Json) -> str:
    known = entry.get("stated_youngs_modulus_Pa")
    return f"stated {measured(known, scale=1e-9, sign='±')}" if known else ""


def _row(cells: tuple[str, ...], tag: str) -> str:
    return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"
