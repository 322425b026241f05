"""What is true around what is stated."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from drivers.simulated.campaign import CampaignSettings, simulate_campaign
from drivers.simulated.label_spread import EXACT, ROOM_K, TYPICAL, LabelSpread, draw_true_labels
from drivers.simulated.specimens import SPHERES, SURFACES
from drivers.simulated.world import World
from drivers.simulated.world_settings import WorldSettings

G = 9.80665
SMALL: dict[str, Any] = {
    "spheres": {"acetal": SPHERES["acetal"]},
    "surfaces": {"polycarbonate": SURFACES["polycarbonate"], "specimen": SURFACES["specimen"]},
    "repeats": 2,
    "speed_repeatability": 0.0,
}


def test_exact_labels_are_the_truth() -> None:
    """Not one bit differs."""
    drawn = draw_true_labels(EXACT, 3, SPHERES, SURFACES, G)
    assert drawn.spheres == SPHERES
    assert drawn.surfaces == SURFACES
    assert drawn.gravity_m_per_s2 == G
    assert (drawn.inputs.sample_rate_factor, drawn.inputs.temperature_k) == (1.0, ROOM_K)


def test_what_is_drawn_scatters_by_the_stated_standard_uncertainty() -> None:
    """Each quantity by itself, over 2000 rigs, within the 5 % that 2000 draws allow."""
    steel = {"steel": SPHERES["steel"]}
    drawn = [
        draw_true_labels(TYPICAL, seed, steel, {"pvc": SURFACES["pvc"]}, G) for seed in range(2000)
    ]
    for values, u in (
        ([d.spheres["steel"].radius_m / 2.99e-3 for d in drawn], TYPICAL.radius_relative),
        ([d.spheres["steel"].mass_kg / 0.878e-3 for d in drawn], TYPICAL.mass_relative),
        ([d.surfaces["pvc"].coupon_mass_kg / 4.2e-3 for d in drawn], TYPICAL.coupon_mass_relative),
        ([d.gravity_m_per_s2 for d in drawn], TYPICAL.gravity_m_per_s2),
        ([d.inputs.height_offset_m for d in drawn], TYPICAL.height_offset_m),
        ([d.inputs.sample_rate_factor for d in drawn], TYPICAL.sample_rate_relative),
        ([d.inputs.temperature_k for d in drawn], TYPICAL.temperature_k),
    ):
        assert np.std(values) == pytest.approx(u, rel=0.05)


def test_heights_share_an_offset_and_scatter_by_themselves() -> None:
    """The truth tells the offset; what is left of the true heights is each drop's own."""
    spread = LabelSpread(height_offset_m=2e-3, height_scatter_m=1e-4)
    made = simulate_campaign(CampaignSettings(spread=spread, rig="paper", **SMALL), 5)
    offset = made["truth"]["inputs"]["height_offset_m"]
    own = [
        truth["true_drop_height_m"] - shot["drop_height_m"]["value"] - offset
        for shot, truth in zip(made["campaign"]["shots"], made["truth"]["shots"], strict=True)
    ]
    assert abs(offset) > 1e-4
    assert 5e-5 < np.std(own) < 2e-4
    for truth in made["truth"]["shots"]:
        fell = math.sqrt(2 * G * truth["true_drop_height_m"])
        assert truth["speed_m_per_s"] == pytest.approx(fell, rel=1e-12)


def test_a_campaign_states_what_it_does_not_know_exactly() -> None:
    """Quantities with u where numbers stood, by the names of the exchange format."""
    made = simulate_campaign(CampaignSettings(spread=TYPICAL, **SMALL), 5)["campaign"]
    assert made["spheres"]["acetal"]["radius_m"] == {"value": 4.76e-3, "u": 2e-3 * 4.76e-3}
    assert made["spheres"]["acetal"]["mass_kg"]["u"] == pytest.approx(5e-4 * 0.6116e-3)
    assert made["surfaces"]["polycarbonate"]["coupon_mass_kg"]["u"] == pytest.approx(3.6e-6)
    assert made["release"]["height_offset_u_m"] == 3e-4
    assert made["shots"][0]["drop_height_m"]["u"] == 1e-4
    assert made["sample_rate_u_relative"] == 25e-6
    assert made["gravity_m_per_s2"] == {"value": G, "u": 3e-4}
    assert made["environment"]["temperature_C"] == {"value": 23.0, "u": 0.6}


def test_undeclared_the_campaign_reads_as_if_all_were_exact() -> None:
    """The same records; the same words as a campaign without spread, but for what was measured."""
    settings = CampaignSettings(spread=TYPICAL, **SMALL)
    stated = simulate_campaign(settings, 5)
    silent = simulate_campaign(dataclasses.replace(settings, states_u=False), 5)
    exact = simulate_campaign(dataclasses.replace(settings, spread=EXACT), 5)
    for a, b in zip(stated["codes"], silent["codes"], strict=True):
        np.testing.assert_array_equal(a, b)
    for key in ("spheres", "gravity_m_per_s2", "release"):
        assert silent["campaign"][key] == exact["campaign"][key]
    assert set(silent["campaign"]) == set(exact["campaign"])
    assert all(isinstance(s["drop_height_m"], float) for s in silent["campaign"]["shots"])


def test_a_fast_clock_makes_pulses_look_long() -> None:
    """With more samples a second the pulse spans as many more samples."""
    seeds = range(40)
    spread = LabelSpread(sample_rate_relative=0.05)
    seed = max(seeds, key=lambda s: _rate(spread, s))
    widths = [
        _width(simulate_campaign(CampaignSettings(spread=s, **SMALL), seed)["codes"][0])
        for s in (EXACT, spread)
    ]
    assert widths[1] / widths[0] == pytest.approx(_rate(spread, seed), rel=0.01)


def _rate(spread: LabelSpread, seed: int) -> float:
    drawn = draw_true_labels(spread, seed, SMALL["spheres"], SMALL["surfaces"], G)
    return drawn.inputs.sample_rate_factor


def _width(codes: np.ndarray) -> float:
    """Return the samples between the half heights of the first pulse, straight between samples."""
    v = codes.astype(float) - np.median(codes[:1000])
    top = int(np.argmax(v[1490:1800])) + 1490
    half = 0.5 * v[top]
    rise = int(np.flatnonzero(v[:top] < half)[-1])
    fall = top + int(np.flatnonzero(v[top:] < half)[0])
    left = rise + (half - v[rise]) / (v[rise + 1] - v[rise])
    right = fall - 1 + (v[fall - 1] - half) / (v[fall - 1] - v[fall])
    return right - left


@pytest.mark.parametrize("bits", [8, 12])
def test_a_coarse_converter_has_steps_of_its_own(bits: int) -> None:
    """Few codes, each worth more, and the same signal to half a step."""
    fine = simulate_campaign(CampaignSettings(**SMALL), 5)
    coarse = simulate_campaign(CampaignSettings(bits=bits, **SMALL), 5)
    step = coarse["campaign"]["shots"][0]["volts_per_code"]
    assert step == 20.0 / 2**bits
    for a, b in zip(fine["codes"], coarse["codes"], strict=True):
        assert np.max(np.abs(b)) <= 2 ** (bits - 1)
        assert np.max(np.abs(a * 20.0 / 65536 - b * step)) <= 0.5 * step + 1e-12
    with pytest.raises(ValueError, match="8 to 16 bits, not 4"):
        simulate_campaign(CampaignSettings(bits=4, **SMALL), 5)


def test_a_daemons_rig_differs_from_its_labels_as_a_campaigns_does() -> None:
    """Same seed, same truth; its clock runs at the true rate."""
    settings = WorldSettings(seed=5, rig="closed", spread=TYPICAL, clock_speed=math.inf)
    truth = World(settings).truth()
    drawn = draw_true_labels(TYPICAL, 5, SPHERES, SURFACES, G)
    assert truth["inputs"] == {"gravity_m_per_s2": drawn.gravity_m_per_s2} | drawn.inputs.to_json()
    assert truth["rig"]["coupon_rides"]  # type: ignore[index]  # a mixed bag
    assert truth["spheres"]["ptfe"]["mass_kg"] == drawn.spheres["ptfe"].mass_kg  # type: ignore[index]
