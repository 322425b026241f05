"""The page "The paper, computed": the template ``paper.md`` filled with claims and tables."""

from __future__ import annotations

from collections.abc import Sequence

from impactd.aliases import Json
from impactd.paper.claim import Claim
from impactd.paper.compute import PaperResult
from impactd.paper.printed_rows import ROW_HEADINGS, row_texts
from impactd.paper.trace_page import CLOSED_HEADINGS, closed_rows
from impactd.paper.turn import TO_BE_FOUND
from impactd.paper.turn_page import (
    LADDER_HEADINGS,
    ladder_rows,
    moduli_headings,
    moduli_rows,
    short_of_one,
    worst_error,
)
from impactd.reports.templating import render

Table = tuple[Sequence[str], list[list[str]]]
_SHORT = ("steel", "aluminium")
_UNITS = {
    "crystal_mass_kg": ("M / g", 1e3),
    "crystal_stiffness_N_per_m": ("k / (GN/m)", 1e-9),
    "crystal_damping_N_s_per_m": ("mu / (kN s/m)", 1e-3),
    "compliance_m_per_V": ("c / (nm/V)", 1e9),
    "gain_N_per_V": ("k c / (N/V)", 1.0),
    "natural_frequency_Hz": ("f0 / kHz", 1e-3),
    "damping_ratio": ("damping ratio", 1.0),
}


def claims_table(claims: Sequence[Claim]) -> str:
    """Return all claims as a Markdown table."""
    return render("claims.md", claims=claims)


def plus_minus(pair: Sequence[float] | None, scale: float = 1.0, digits: int = 3) -> str:
    """Return mean and standard deviation, ``-`` for None."""
    if pair is None:
        return "-"
    return f"{pair[0] * scale:.{digits}g} ± {pair[1] * scale:.2g}"


def gigapascals(modulus_pa: float) -> str:
    """Return a modulus in GPa; one that ran away reads as infinity."""
    return f"{modulus_pa / 1e9:.2f}" if modulus_pa < 1e12 else "∞"


def table_3_rows(found: Json) -> list[list[str]]:
    """Return Table 3 as rows of text: quantity, paper, true, calibrated, error."""
    rows = []
    for name, (label, scale) in _UNITS.items():
        row = found["cell"][name]
        rows.append(
            [
                label,
                plus_minus(row["paper"], scale),
                plus_minus(row["true"], scale),
                plus_minus(row["calibrated"], scale),
                f"{100 * row['rms_relative_error']:.2g} %",
            ]
        )
    gain, r2 = found["hsd_gain_N_per_V"], found["r2"]
    for way, label in (
        ("aligned", "S of HSD, touch-down free / (N/V)"),
        ("onset", "S of HSD, touch-down at onset / (N/V)"),
        ("peak", "S of HSD, peak over peak / (N/V)"),
    ):
        rows.append([label, plus_minus(gain["paper"]), "-", plus_minus(gain[way]), "-"])
    for way, label, paper in (
        ("hsd_aligned", "R2 of HSD, touch-down free", "paper_hsd"),
        ("hsd_onset", "R2 of HSD, touch-down at onset", "paper_hsd"),
        ("kv", "R2 of KV", "paper_kv"),
    ):
        rows.append([label, plus_minus(r2[paper], digits=2), "-", plus_minus(r2[way]), "-"])
    return rows


def pair_rows(entries: Sequence[Json]) -> list[list[str]]:
    """Return Tables 4-5 as rows of text."""

    def number(value: float | None) -> str:
        """Return two decimals, ``-`` for None."""
        return "-" if value is None else f"{value:.2f}"

    return [
        [
            f"{e['sphere']} / {e['surface']}",
            f"{e['contact_time_s'] * 1e6:.0f}",
            number(e["paper_hsd_over_literature"]),
            number(e["paper_kv_over_literature"]),
            number(e["paper_hsd_over_kv"]),
            "{:.2f} ± {:.2f}".format(*e["ratio"]["hsd_aligned"]),
            "{:.2f} ± {:.2f}".format(*e["ratio"]["hsd_onset"]),
            "{:.3f} ± {:.3f}".format(*e["ratio"]["kv_aligned"]),
            "{:.4f} ± {:.4f}".format(*e["ratio"]["kv_joint"]),
            "{:.2f} / {:.2f} / {:.4f}".format(
                *(e["r2"][w] for w in ("hsd_aligned", "hsd_onset", "kv_joint"))
            ),
        ]
        for e in entries
    ]


PAIR_HEADINGS = (
    "sphere / surface",
    "contact / µs",
    "HSD, paper",
    "KV, paper",
    "HSD/KV, paper",
    "HSD, free",
    "HSD, onset",
    "KV, free",
    "KV, joint",
    "R2 (free / onset / KV)",
)


def spread_rows(found: Json) -> list[list[str]]:
    """Return how the paper's moduli of one material differ between pairs."""
    return [
        [
            name,
            ", ".join(f"{m:g}" for m in row["moduli_GPa"]),
            f"{100 * row['relative_std_between_pairs']:.0f} %",
            f"{100 * row['median_relative_std_stated']:.1f} %",
        ]
        for name, row in found.items()
    ]


def valley_rows(fits: Sequence[Json]) -> list[list[str]]:
    """Return where the fits of one pair began and ended."""
    moduli = ("start_sphere_Pa", "start_surface_Pa", "sphere_Pa", "surface_Pa")
    return [
        [
            *(gigapascals(fit[key]) for key in moduli),
            f"{fit['reduced_modulus_Pa'] / 1e9:.5f}",
            f"{fit['excess_chi2']:.2g}",
        ]
        for fit in fits
    ]


def page(result: PaperResult, command: str) -> str:
    """Return the whole page.

    Returns
    -------
    str
        Markdown; the pictures stand in ``pictures/`` beside it.
    """
    found = result.to_json()
    return render(
        "paper.md",
        result=result,
        found=found,
        command=command,
        tables=_tables(result, found),
        steel=next(e for e in found["tables_4_5"] if (e["sphere"], e["surface"]) == _SHORT),
        sought=TO_BE_FOUND,
        short_of_one=short_of_one,
        worst_error=worst_error,
    )


def _tables(result: PaperResult, found: Json) -> dict[str, Table]:
    """Return headings and rows of each table by its name in the template."""
    clean, leaky = result.turns
    spread = found["paper_spread_of_materials"]["table5_kv"]
    return {
        "table3": (
            ("quantity", "paper", "rigs as drawn", "calibrated", "rms error of the calibrations"),
            table_3_rows(found["table3"]),
        ),
        "pairs": (PAIR_HEADINGS, pair_rows(found["tables_4_5"])),
        "rows_4": (ROW_HEADINGS, row_texts(result.printed, "table4_hsd")),
        "rows_5": (ROW_HEADINGS, row_texts(result.printed, "table5_kv")),
        "closed": (CLOSED_HEADINGS, closed_rows(found["closed_model"])),
        "clean_ladder": (LADDER_HEADINGS, ladder_rows(clean)),
        "clean_moduli": (
            moduli_headings(clean, with_paper=True),
            moduli_rows(clean, with_paper=True),
        ),
        "leaky_ladder": (LADDER_HEADINGS[:4], [row[:4] for row in ladder_rows(leaky)]),
        "leaky_moduli": (
            moduli_headings(leaky, with_paper=False),
            moduli_rows(leaky, with_paper=False),
        ),
        "fits": (
            ("start E_p", "start E_s", "end E_p", "end E_s", "end E*", "excess chi2"),
            valley_rows(found["valley"]["fits"]),
        ),
        "spread": (
            ("material", "E from its pairs / GPa", "std between pairs", "median std stated"),
            spread_rows(spread),
        ),
    }
