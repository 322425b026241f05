"""Every finished model's numbers are such as the things they belong to can have, or it says which
are not.
"""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from analysis import fit_campaign, observation_from_fit
from analysis.campaign import Campaign, Quantity, Shot, Sphere, Surface
from analysis.diagnosis.basis.proposals import rescoped
from analysis.diagnosis.candidate import extended
from analysis.diagnosis.procedure import _crystal
from analysis.diagnosis.progress import Watch
from analysis.diagnosis.selection import Selection, Step
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.blocks import linearise_shot
from analysis.fit.physical_range import effect_out_of_range, out_of_range
from analysis.fit.problem import build
from analysis.fit.result import FitResult
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named


@pytest.fixture(scope="module")
def fit(made: tuple[Any, Campaign]) -> FitResult:
    """A sound fit."""
    return fit_campaign(made[1], "kv", heldout=False)


def _moved(fit: FitResult, **logs: float) -> joint.Fitted:
    """Return the fit with the logarithms of globals of the cell where they are told to be."""
    theta = fit.fitted.theta.copy()
    for name, value in logs.items():
        theta[fit.problem.names.index(f"sensor.{name}")] = value
    return dataclasses.replace(fit.fitted, theta=theta)


def test_a_sound_fit_is_within_all_ranges(fit: FitResult) -> None:
    """Nothing is flagged on a rig whose numbers are those of a rig."""
    assert out_of_range(fit.problem, fit.fitted) == []
    assert fit.outcome.status == "converged"
    assert fit.to_json()["out_of_range"] == []


def test_a_ring_beyond_what_samples_show_is_out_of_range(fit: FitResult) -> None:
    """667 kHz in records of 1 MHz is named with its range, half the sample rate."""
    (found,) = out_of_range(fit.problem, _moved(fit, ln_w=math.log(2 * math.pi * 667e3)))[:1]
    assert found.name == "sensor.natural_frequency_Hz"
    assert found.value == pytest.approx(667e3)
    assert found.high == 5e5
    assert "6.67e+05 Hz" in found.sentence
    assert "5e+05 Hz" in found.sentence


def test_a_crystal_of_137_kg_is_out_of_range(fit: FitResult) -> None:
    """A mass that no cell has is named, unless the data leave it open by as much."""
    heavy = _moved(fit, ln_M=math.log(137.0))
    names = [one.name for one in out_of_range(fit.problem, heavy)]
    assert "sensor.crystal_mass_kg" in names
    wide = heavy.covariance.copy()
    j = fit.problem.names.index("sensor.ln_M")
    wide[j, j] = 2.0**2
    loose = dataclasses.replace(heavy, covariance=wide)
    names = [one.name for one in out_of_range(fit.problem, loose)]
    assert "sensor.crystal_mass_kg" not in names


def test_what_a_certificate_states_is_possible(fit: FitResult) -> None:
    """A giant's cell of 137 kg is one where its certificate says so."""
    sensor = dataclasses.replace(fit.problem.campaign.sensor, crystal_mass_kg=Quantity(100.0, 20.0))
    campaign = dataclasses.replace(fit.problem.campaign, sensor=sensor)
    problem = dataclasses.replace(fit.problem, campaign=campaign)
    names = [one.name for one in out_of_range(problem, _moved(fit, ln_M=math.log(137.0)))]
    assert "sensor.crystal_mass_kg" not in names


def test_a_fit_with_an_impossible_number_states_no_modulus(fit: FitResult) -> None:
    """Moduli are withheld with the number and its range; the network takes no such fit."""
    moved = _moved(fit, ln_w=math.log(2 * math.pi * 667e3))
    bad = dataclasses.replace(fit, fitted=moved)
    entry = bad.moduli()["specimen"]
    assert entry["status"] == "withheld"
    assert "natural_frequency" in entry["reason"]
    document = bad.to_json()
    assert document["budget"] is None
    assert document["out_of_range"][0]["high"] == 5e5
    json.dumps(document, allow_nan=False)


def _rigid(impact: Any, rate_hz: float = 2e5) -> Campaign:
    """Return three drops on a cell that follows at once, recorded slowly."""
    rng, mass, radius = np.random.default_rng(1), 6e-4, 4.76e-3
    stiffness = 4 / 3 * math.sqrt(radius) * 1e9
    shots = []
    for height, restitution in ((0.03, 0.8), (0.05, 0.82), (0.08, 0.84)):
        times = (np.arange(840) - 180 + rng.uniform()) / rate_hz
        speed = math.sqrt(2 * 9.80665 * height)
        force = impact(stiffness, mass, speed, restitution, rtol=1e-9).solve(times)[0]
        signal = force + 0.01 * rng.standard_normal(times.size)
        shots.append(Shot(f"{height} m", signal, rate_hz, 181, "voltage", "ball", "coupon", height))
    ratio = Quantity(0.35, 0.01)
    return Campaign(
        tuple(shots),
        {"ball": Sphere("ball", radius, mass, None, ratio)},
        {"coupon": Surface("coupon", None, ratio)},
        speed_repeatability=0.003,
    )


def test_a_rigid_cell_is_not_said_to_ring(impact: Any) -> None:
    """A ringing cell fits a rigid one's records only beyond the samples: neither fit nor diagnosis
    takes it.
    """
    campaign = _rigid(impact)
    found = fit_campaign(campaign, "kv", by_pair=True, heldout=False)
    assert found.outcome.status == "out_of_range"
    assert "natural_frequency_Hz" in found.outcome.message
    assert "1e+05 Hz" in found.outcome.message
    assert "out_of_range" in found.flags()
    assert observation_from_fit(found, shot="1") is None
    model = model_named("hsd")
    problem, nuisances = with_start(build(campaign, model))
    base = Step(problem, joint.fit(problem, nuisances))
    trail, _ = _crystal(campaign, Selection([base], []), base.fitted, Watch())
    (crystal,) = base.refits
    assert not trail.chosen
    assert crystal.at_bound
    assert not crystal.usable


@pytest.mark.parametrize(("stiffness", "outside"), [(3.5e12, True), (5e9, False)])
def test_a_tape_stiffer_than_any_is_no_tape(
    fit: FitResult, stiffness: float, outside: bool
) -> None:
    """The stiffness is what shows the tape: beyond its bound the effect is not found, however
    little the records say of the number.
    """
    effect = effect_named("adhesive_layer")
    logs = {
        "adhesive_layer.stiffness_n_per_m": math.log(stiffness),
        "adhesive_layer.damping_n_s_per_m": math.log(300.0),
    }
    problem, theta, nuisances = extended(fit.problem, fit.fitted, effect, logs)
    size = len(problem.names)
    covariance = np.zeros((size, size))
    old = fit.fitted.covariance.shape[0]
    covariance[:old, :old] = fit.fitted.covariance
    covariance[range(old, size), range(old, size)] = 4.0**2
    fitted = dataclasses.replace(
        fit.fitted, theta=theta, nuisances=nuisances, covariance=covariance
    )
    names = [one.name for one in out_of_range(problem, fitted)]
    assert ("adhesive_layer.stiffness_n_per_m" in names) is outside


@pytest.mark.parametrize(("shares", "outside"), [((0.03, 0.05), False), ((-0.03, 0.05), True)])
def test_no_single_shot_has_a_mass_below_nothing(
    fit: FitResult, shares: tuple[float, float], outside: bool
) -> None:
    """Masses that are nothing on the whole, less than nothing in some shots, are no masses."""
    effect = rescoped(effect_named("coupon_mode"), "shot")
    logs = {"coupon_mode.frequency_hz": math.log(2e4), "coupon_mode.damping_ratio": math.log(0.03)}
    problem, theta, nuisances = extended(fit.problem, fit.fitted, effect, logs)
    at = problem.model.nuisances.index("coupon_mode.mass_share")
    nuisances[:, at] = [shares[row % 2] for row in range(len(nuisances))]
    blocks = [
        linearise_shot(problem, item, theta, own)
        for item, own in zip(problem.shots, nuisances, strict=True)
    ]
    assert None not in blocks
    fitted = dataclasses.replace(
        fit.fitted,
        theta=theta,
        nuisances=nuisances,
        blocks=[block for block in blocks if block is not None],
        covariance=np.zeros((theta.size, theta.size)),
    )
    assert any(effect_out_of_range(problem, fitted, effect)) is outside
