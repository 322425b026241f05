"""Records that fill the converter's range: the range is known, so they are fitted like others."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from analysis.campaign import Shot
from analysis.fit.campaign_fit import fit_campaign
from analysis.fit.problem import FitShot, build
from analysis.fit.window import cut, rail
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings
from drivers.simulated.effects import make_effect
from impactd.bench.simulated_campaign import simulated_campaign

QUANTUM = 10.0 / 32768
TAPE = {"stiffness_n_per_m": 4.6e7, "damping_n_s_per_m": 120.0}


def pulse(height: float, zero: float = 0.0) -> Shot:
    """Return codes of a half-sine of that height in volts, as a 10 V converter gives them."""
    x = np.zeros(3000)
    x[1000:1080] = height * np.sin(np.pi * np.arange(80) / 80)
    x += 2e-3 * np.random.default_rng(4).standard_normal(x.size)
    codes = np.clip(np.rint(x / QUANTUM), -32768, 32767)
    return Shot("shot 1", codes * QUANTUM + zero, 1e6, 1005, quantum=QUANTUM, code_zero=zero)


@pytest.mark.parametrize("zero", [0.0, -0.03])
def test_the_rail_is_the_converters_range(zero: float) -> None:
    """A window at full scale has both ends of the range, in its own sign; others have none."""
    up, down = pulse(10.4, zero), pulse(-10.4, zero)
    ends = (-10.0 + zero, 10.0 - QUANTUM + zero)
    assert rail(up, cut(up)) == pytest.approx(ends, abs=1e-12)
    assert rail(down, cut(down)) == pytest.approx((-ends[1], -ends[0]), abs=1e-12)
    below = pulse(9.98, zero)
    assert rail(below, cut(below)) is None


def test_a_record_of_unknown_or_finer_steps_has_no_rail() -> None:
    """Without a step nothing is known of the range; codes beyond 16 bits have another one."""
    full = pulse(10.4)
    for quantum in (None, QUANTUM / 16):
        other = dataclasses.replace(full, quantum=quantum)
        assert rail(other, cut(other)) is None


def test_drops_beyond_the_range_are_fitted_to_their_noise() -> None:
    """Drops beyond 10 V and coupons that swing back further than they were pushed.

    From a tape six times too stiff, every shot reaches its noise and the tape is found.
    """
    settings = CampaignSettings(effects=(make_effect("adhesive_layer", TAPE),))
    result = fit_campaign(simulated_campaign(settings, 4), "kv2+adhesive_layer", heldout=False)
    full = [s for s in result.shots if s.item.frame.rail is not None]
    assert len(full) >= 2
    assert max(s.chi2_per_dof for s in result.shots) < 1.2
    assert {s.item.window.polarity for s in result.shots} == {1}
    assert all("clipped" in s.flags() for s in full if s.item.shot.clipped)
    found = dict(zip(result.problem.names, result.fitted.theta, strict=True))
    for name, value in TAPE.items():
        assert math.exp(found[f"adhesive_layer.{name}"]) == pytest.approx(value, rel=1e-3)


def shots_of(limit_v: float) -> list[FitShot]:
    """Return the shots of a campaign whose amplifier ends at that voltage."""
    clipped = make_effect("clipping", {"limit_v": limit_v, "softness": 0.0})
    campaign = simulated_campaign(CampaignSettings(effects=(clipped,), repeats=1), 4)
    return build(campaign, model_named("kv2")).shots


def test_an_amplifiers_limit_is_no_rail() -> None:
    """Flat tops below the converter's range stay an effect to be found."""
    shots = shots_of(5.0)
    assert any(s.shot.clipped or s.window.peak > 4.9 for s in shots)
    assert all(s.frame.rail is None for s in shots)
