"""What the paper says of its Tables 3-5 as wholes, beside the simulated rigs."""

from __future__ import annotations

import math

from impactd.aliases import Json
from impactd.paper.claim import FAILS, HOLDS, Claim
from impactd.paper.source import distance_from_literature, literature, rows

MEAN_R2 = {"table4_hsd": 0.48, "table5_kv": 0.86}
"""The text's."""


def table_claims(table_3: Json, mean_r2: Json) -> list[Claim]:
    """Return the claims.

    Parameters
    ----------
    table_3, mean_r2 : dict
        As `compute` makes them from the rigs.

    Returns
    -------
    list of Claim
        In the order of the tables.
    """
    return [
        _gain(table_3["hsd_gain_N_per_V"]),
        *_calibration_r2(table_3["r2"]),
        *_pair_r2(mean_r2),
        _nearer(),
    ]


def _gain(found: Json) -> Claim:
    ours = [found[way][0] for way in ("peak", "aligned", "onset")]
    mean, std = found["paper"]
    return Claim(
        "table3_s",
        "Table 3",
        "HSD's S",
        f"{mean:.2f} ± {std:.2f} N/V",
        f"{min(ours):.2f}-{max(ours):.2f} N/V by three ways of reading it",
        HOLDS if min(ours) - std <= mean <= max(ours) + std else FAILS,
        {"low_N_per_V": min(ours), "high_N_per_V": max(ours)},
        "no property of the cell: it depends on the pairs and on how curves are laid",
    )


def _calibration_r2(found: Json) -> list[Claim]:
    hsd = [found[way][0] for way in ("hsd_aligned", "hsd_onset")]
    (mean, std), (kv_mean, kv_std) = found["paper_hsd"], found["paper_kv"]
    return [
        Claim(
            "table3_r2_hsd",
            "Table 3",
            "R2 of the calibrations, HSD",
            f"{mean:.2f} ± {std:.2f}",
            f"{min(hsd):.2f}-{max(hsd):.2f}",
            HOLDS if min(hsd) <= mean + std and max(hsd) >= mean - std else FAILS,
            {"low": min(hsd), "high": max(hsd)},
        ),
        Claim(
            "table3_r2_kv",
            "Table 3",
            "R2 of the calibrations, KV",
            f"{kv_mean:.2f} ± {kv_std:.2f}",
            f"{found['kv'][0]:.4f}",
            FAILS,
            {"mean": found["kv"][0]},
            "a cell that is a KV element leaves nothing to explain; 7 % of a variance is no noise",
        ),
    ]


def _pair_r2(found: Json) -> list[Claim]:
    hsd = [found[way] for way in ("hsd_onset", "hsd_aligned")]
    theirs_hsd, theirs_kv = MEAN_R2.values()
    return [
        Claim(
            "table4_r2",
            "Table 4, text",
            "mean R2 over the pairs, HSD",
            f"{theirs_hsd:.2f}",
            f"{min(hsd):.2f}-{max(hsd):.2f}",
            FAILS,
            {"low": min(hsd), "high": max(hsd)},
            "the crystal alone costs HSD less than half of what the paper's fits lack",
        ),
        Claim(
            "table5_r2",
            "Table 5, text",
            "mean R2 over the pairs, KV",
            f"{theirs_kv:.2f}",
            f"{found['kv_joint']:.4f}",
            FAILS,
            {"mean": found["kv_joint"]},
            "something else is in that rig: a coupon that M leaves out would cost as much (above)",
        ),
        Claim(
            "kv_fits_better",
            "Tables 4-5, text",
            "KV fits better than HSD",
            f"{theirs_kv:.2f} against {theirs_hsd:.2f}",
            f"{found['kv_joint']:.2f} against {max(hsd):.2f}",
            HOLDS if found["kv_joint"] > max(hsd) else FAILS,
        ),
    ]


def _nearer() -> Claim:
    common = set(rows("table4_hsd"))
    hsd, kv = (distance_from_literature(table, common) for table in MEAN_R2)
    nearer = sum(
        _distance(one_kv, stated) < _distance(one_hsd, stated)
        for one_hsd, one_kv, stated in _moduli()
    )
    return Claim(
        "nearer_to_literature",
        "Tables 4-5, abstract",
        "KV's moduli are nearer to the literature's, mean |ln(E/E_literature)|",
        "nearer",
        f"{kv:.2f} against {hsd:.2f}; {nearer} of {2 * len(common)} moduli are",
        HOLDS if kv < hsd else FAILS,
        {"hsd": hsd, "kv": kv, "nearer": float(nearer)},
        "what is left is not the crystal: KV reads such rigs to 0.1 %",
    )


def _moduli() -> list[tuple[float, float, float]]:
    """Return HSD's, KV's and the literature's E of each modulus of Table 4. [Pa]"""
    kv, found = rows("table5_kv"), []
    for pair, row in rows("table4_hsd").items():
        found.append((row.sphere_pa, kv[pair].sphere_pa, literature("sphere", pair[0])[0]))
        found.append((row.surface_pa, kv[pair].surface_pa, literature("surface", pair[1])[0]))
    return found


def _distance(modulus_pa: float, stated_pa: float) -> float:
    return abs(math.log(modulus_pa / stated_pa))
