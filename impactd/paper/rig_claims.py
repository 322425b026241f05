"""Claims about the rig's contacts, and slips of the printed text."""

from __future__ import annotations

import math

from analysis.paper import numbers
from analysis.paper.contact import TABLE3_CELL, drop_of
from impactd.paper.claim import FAILS, SLIP, Claim
from impactd.paper.source import literature_reduced, reduced, rows, tables

HEIGHT_M = 0.047


def rig_claims() -> list[Claim]:
    """Return what is said of contact times."""
    times = {}
    for sphere, surface in rows("table5_kv"):
        entry = tables()["sphere"][sphere]
        modulus = literature_reduced((sphere, surface))
        drop = drop_of(entry["radius_m"], entry["mass_kg"], modulus, HEIGHT_M)
        times[f"{sphere}-{surface}"] = numbers.loss_free_contact_time(drop)
    steel = tables()["sphere"]["steel"]
    on_steel = reduced(("steel", "aluminium"), 194e9, 194e9)  # both have nu 0.33
    short = numbers.loss_free_contact_time(
        drop_of(steel["radius_m"], steel["mass_kg"], on_steel, HEIGHT_M)
    )
    outside = sorted(pair for pair, t in times.items() if not 30e-6 <= t <= 150e-6)
    return [
        Claim(
            "contact_times",
            "the rig (notes)",
            "contacts last",
            "30-150 us",
            f"{min(times.values()) * 1e6:.0f}-{max(times.values()) * 1e6:.0f} us over the paper's "
            f"pairs, h {HEIGHT_M * 100:g} cm, eps 1",
            FAILS,
            times,
            f"outside: {', '.join(outside)}",
        ),
        Claim(
            "steel_on_steel",
            "the rig (notes)",
            "steel on steel against the sensor's period",
            "10 us against 58 us",
            f"{short * 1e6:.0f} us against {1e6 / TABLE3_CELL.natural_frequency_hz:.0f} us",
            FAILS,
            {"contact_s": short, "period_s": 1 / TABLE3_CELL.natural_frequency_hz},
            "10 us is the time to the peak, half the contact; the conclusion stands",
        ),
    ]


def slips() -> list[Claim]:
    """Return the slips of the printed text that matter to whoever computes with it."""
    density = {
        name: s["mass_kg"] / (4 / 3 * math.pi * s["radius_m"] ** 3)
        for name, s in tables()["sphere"].items()
    }
    return [
        Claim(
            "radii",
            "Table 1",
            "radii, in the unit that fits the masses",
            "cm",
            ", ".join(f"{name} {rho:.0f}" for name, rho in density.items()) + " kg/m^3",
            SLIP,
            {f"density_{name}": rho for name, rho in density.items()},
            "only centimetres give the masses these densities",
        ),
        Claim(
            "eq2_exponent", "Eq. 2", "the text's '32'", "32", "3/2", SLIP, {}, "a lost fraction bar"
        ),
        Claim(
            "eq6_dot",
            "Eq. 6",
            "eps from delta",
            "delta(tau)",
            "delta'(tau)",
            SLIP,
            {},
            "printed without the second dot; delta itself is 0 there",
        ),
        Claim("pvc_nu", "Table 2", "Poisson's ratio of PVC", "0.38-4.1", "0.38-0.41", SLIP),
        Claim(
            "ptfe_row",
            "Table 2",
            "PTFE as a surface",
            "no row",
            "Table 1's PTFE",
            SLIP,
            {},
            "Tables 4-5 use it",
        ),
        Claim(
            "r2_order",
            "text",
            "mean R2 'much greater for the HSD model (0.48) compared to the KV model (0.86)'",
            "HSD > KV",
            "KV > HSD",
            SLIP,
            {},
            "the wrong way round",
        ),
    ]
