"""The paper's claims: each of ours pinned, each verdict with its reason, the page up to date."""

from __future__ import annotations

from pathlib import Path

import pytest

from impactd.paper.claim import FAILS, HOLDS, NEARLY, NO_CLAIM, SLIP, Claim
from impactd.paper.claims import all_claims
from impactd.paper.page import claims_table

PAGE = Path(__file__).parents[3] / "analysis" / "paper.md"

# key: (verdict, {value: (ours, tolerance)}); sources: the claim's own `where`, values ours
PINNED: dict[str, tuple[str, dict[str, tuple[float, float]]]] = {
    "fig2_peak_force": (HOLDS, {"low_N": (15.565, 1e-3), "high_N": (18.983, 1e-3)}),
    "fig2_peak_time": (FAILS, {"low_s": (36.23e-6, 1e-8), "high_s": (37.84e-6, 1e-8)}),
    "fig2_total_peak": (
        HOLDS,
        {
            "low_s": (32.3e-6, 1e-7),
            "high_s": (37.85e-6, 1e-7),
            "low_N": (15.90, 1e-2),
            "high_N": (18.98, 1e-2),
        },
    ),
    "fig2_delay": (HOLDS, {"s": (11.08e-6, 1e-8)}),
    "fig2_ratio": (HOLDS, {"low": (931.7, 0.1), "high": (984.0, 0.1)}),
    "fig3_ring": (HOLDS, {"frequency_Hz": (17207.0, 1.0), "damping_ratio": (0.07296, 1e-5)}),
    "fig3_duration": (
        HOLDS,
        {"to_5_percent_s": (378.7e-6, 1e-7), "to_1_percent_s": (582.2e-6, 1e-7)},
    ),
    "fig3_overshoot": (NO_CLAIM, {"overshoot": (1.499, 1e-3), "delay_s": (8.59e-6, 1e-8)}),
    "fig4_difference": (
        HOLDS,
        {
            "low_N": (0.00717, 1e-5),
            "high_N": (0.08644, 1e-5),
            "low": (4.287e-4, 1e-7),
            "high": (5.170e-3, 1e-6),
        },
    ),
    "fig4_corner": (NEARLY, {"N": (0.1026, 1e-4), "relative": (0.0054, 1e-4)}),
    "fig4_total": (NEARLY, {"low_N": (0.024, 2e-3), "high_N": (0.612, 5e-3)}),
    "rebound_ratio": (
        FAILS,
        {
            "ratio": (0.79950, 1e-5),
            "rigid": (0.79993, 1e-5),
            "seen_after_s": (0.734e-3, 1e-6),
            "at_2.5_ms": (0.7740, 1e-4),
        },
    ),
    "rk4_error": (HOLDS, {"error": (2.76e-4, 5e-6), "factor": (2.37, 0.05)}),
    "table3_frequency": (HOLDS, {"frequency_Hz": (17253.0, 0.1), "damping_ratio": (0.07296, 1e-5)}),
    "table3_gain": (FAILS, {"k_c_N_per_V": (2.3296, 1e-4), "ratio": (1.309, 1e-3)}),
    "table3_mass": (HOLDS, {"fig2": (1.20e-3, 2e-5), "table3": (4.36e-3, 2e-5)}),
    "fig56_ring": (
        HOLDS,
        {
            "share_low": (0.0790, 1e-3),
            "share_high": (0.5462, 1e-3),
            "hsd_r2_low": (0.5031, 1e-3),
            "hsd_r2_high": (0.9131, 1e-3),
            "kv_r2_low": (1.0, 1e-8),
        },
    ),
    "residual_growth": (
        FAILS,
        {
            "kv_largest": (0.0, 1e-5),
            "hsd_stiffest": (0.797, 1e-3),
            "hsd_softest": (0.316, 1e-3),
            "hsd_rank_correlation": (0.43, 0.05),
        },
    ),
    "residual_growth_closed": (
        HOLDS,
        {
            "held_stiffest": (0.0215, 1e-4),
            "held_largest": (0.1537, 1e-3),
            "free_stiffest": (0.0006, 1e-4),
            "free_largest": (0.0471, 1e-3),
            "free_rank_correlation": (-0.80, 0.05),
        },
    ),
    "second_peak": (
        HOLDS,
        {
            "earliest_s": (151.8e-6, 2e-7),
            "latest_s": (163.2e-6, 2e-7),
            "lowest": (0.0650, 1e-3),
            "highest": (0.1008, 1e-3),
        },
    ),
    "broad_ptfe": (
        HOLDS,
        {
            "ptfe_low_s": (66.5e-6, 2e-7),
            "ptfe_high_s": (117.1e-6, 2e-7),
            "others_low_s": (15.4e-6, 2e-7),
            "others_high_s": (57.2e-6, 2e-7),
        },
    ),
    "poissons_ratio": (FAILS, {"modulus_factor": (0.89496, 1e-5)}),
    "seconds": (HOLDS, {"steps": (136, 0)}),
    "coupon_mass": (
        NO_CLAIM,
        {
            "reference_mean": (0.8912, 1e-3),
            "reference_std": (0.1040, 1e-3),
            "mean": (0.9404, 1e-3),
            "masses_std_kg": (2.083e-3, 1e-6),
        },
    ),
    "contact_times": (
        FAILS,
        {
            "steel-aluminium": (27.6e-6, 1e-7),
            "acetal-polycarbonate": (93.5e-6, 1e-7),
            "ptfe-ptfe": (208.8e-6, 1e-7),
            "neoprene-ptfe": (195.8e-6, 1e-7),
        },
    ),
    "steel_on_steel": (FAILS, {"contact_s": (21.3e-6, 1e-7), "period_s": (57.96e-6, 1e-8)}),
    "radii": (SLIP, {"density_steel": (7841.0, 1.0), "density_acetal": (1354.0, 1.0)}),
    "eq2_exponent": (SLIP, {}),
    "eq6_dot": (SLIP, {}),
    "pvc_nu": (SLIP, {}),
    "ptfe_row": (SLIP, {}),
    "r2_order": (SLIP, {}),
}


@pytest.fixture(scope="module")
def claims() -> dict[str, Claim]:
    """Return all claims by key."""
    return {claim.key: claim for claim in all_claims()}


def test_every_claim_is_pinned(claims: dict[str, Claim]) -> None:
    """No claim enters the page without a pinned number and verdict here."""
    assert set(claims) == set(PINNED)


@pytest.mark.parametrize("key", PINNED)
def test_our_number_and_verdict(claims: dict[str, Claim], key: str) -> None:
    """Each of our numbers stays where it was when its verdict was given."""
    verdict, values = PINNED[key]
    assert claims[key].verdict == verdict
    for name, (value, tolerance) in values.items():
        assert claims[key].values[name] == pytest.approx(value, abs=tolerance), name


def test_whatever_does_not_hold_says_why(claims: dict[str, Claim]) -> None:
    """A verdict against a claim carries its reason."""
    assert all(c.note for c in claims.values() if c.verdict in {FAILS, NEARLY})


def test_the_committed_page_has_these_claims(claims: dict[str, Claim]) -> None:
    """`analysis/paper.md` shows what the code computes; else run the command it names."""
    assert claims_table(list(claims.values())) in PAGE.read_text(encoding="utf-8")


def test_the_committed_pages_pictures_exist() -> None:
    """Every picture of the page lies beside it."""
    names = [
        line.split("](")[1].rstrip(")") for line in PAGE.read_text().splitlines() if "![" in line
    ]
    assert len(names) == 8
    assert all((PAGE.parent / name).stat().st_size < 250_000 for name in names)
