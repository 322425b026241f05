"""Masses, radii, heights and the time base as quantities with an uncertainty in the joint fit."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Uncertainty
from analysis.fit.campaign_fit import solve
from analysis.fit.problem import build
from analysis.fit.result import FitResult
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

SPECIMEN = "surface.specimen"
NEXT_TO_NOTHING = 1e-7
"""Relative; the fit then believes every input, as the one that takes them as exact does."""


def declared(
    campaign: Campaign, *, mass: float, radius: float, height_m: float, rate: float, g: float
) -> Campaign:
    """Return a campaign with relative uncertainties of its inputs, and one of the heights [m]."""
    spheres = {
        name: dataclasses.replace(
            one,
            u_mass_kg=Uncertainty(mass * (one.mass_kg or 0.0)),
            u_radius_m=Uncertainty(radius * (one.radius_m or 0.0)),
        )
        for name, one in campaign.spheres.items()
    }
    return dataclasses.replace(
        campaign,
        spheres=spheres,
        u_height_offset_m=Uncertainty(height_m),
        u_sample_rate_relative=Uncertainty(rate),
        u_gravity_m_per_s2=Uncertainty(g * campaign.gravity_m_per_s2),
    )


def honest(campaign: Campaign) -> Campaign:
    """Return a campaign with uncertainties that a careful laboratory would state."""
    return declared(campaign, mass=5e-4, radius=2e-3, height_m=3e-4, rate=25e-6, g=1e-5)


def log_modulus(result: FitResult) -> tuple[float, float]:
    """Return ln E' of the specimen and its standard uncertainty."""
    j = result.problem.names.index(SPECIMEN)
    return float(result.fitted.theta[j]), math.sqrt(float(result.fitted.covariance[j, j]))


def sensitivities(result: FitResult) -> dict[str, float]:
    """Return d ln E' of the specimen by the stated coordinate of each input."""
    j = result.problem.names.index(SPECIMEN)
    follows = result.fitted.covariance[j] @ result.problem.prior_precision
    return {i.name: follows[result.problem.names.index(i.name)] for i in result.problem.inputs}


@pytest.fixture(scope="module")
def exact(made: tuple[Any, Campaign]) -> FitResult:
    """Return the fit that takes every input as exact."""
    return fit_campaign(made[1], "kv", heldout=False)


Shifted = tuple[Callable[[Campaign], Campaign], tuple[str, ...], float]


@pytest.fixture(scope="module")
def believed(made: tuple[Any, Campaign]) -> FitResult:
    """Return the fit whose inputs have next to no uncertainty."""
    tiny = NEXT_TO_NOTHING
    campaign = declared(made[1], mass=tiny, radius=tiny, height_m=tiny * 1e-2, rate=tiny, g=tiny)
    return fit_campaign(campaign, "kv", heldout=False)


def test_exact_inputs_leave_the_fit_as_it_was(
    made: tuple[Any, Campaign], exact: FitResult, believed: FitResult
) -> None:
    """Without uncertainties no number moves, and the result says what it took as exact."""
    problem, nuisances = with_start(build(made[1], model_named("kv")))
    fitted, _ = solve(problem, nuisances)
    assert np.array_equal(exact.fitted.theta, fitted.theta)
    assert exact.problem.inputs == ()
    (sentence,) = [s for s in exact.problem.assumptions if "exact" in s]
    assert "spheres.acetal.mass_kg" in sentence
    assert "release.height_offset_u_m" in sentence
    assert not [s for s in believed.problem.assumptions if "mass_kg" in s]
    assert log_modulus(believed)[0] == pytest.approx(log_modulus(exact)[0], abs=1e-6)


def _heavier(campaign: Campaign, names: tuple[str, ...]) -> Campaign:
    spheres = {
        n: dataclasses.replace(one, mass_kg=(one.mass_kg or 0.0) * (1.005 if n in names else 1.0))
        for n, one in campaign.spheres.items()
    }
    return dataclasses.replace(campaign, spheres=spheres)


def _larger(campaign: Campaign) -> Campaign:
    spheres = {
        n: dataclasses.replace(one, radius_m=(one.radius_m or 0.0) * 1.005)
        for n, one in campaign.spheres.items()
    }
    return dataclasses.replace(campaign, spheres=spheres)


def _of_shots(campaign: Campaign, change: Callable[[Any], Any]) -> Campaign:
    return dataclasses.replace(campaign, shots=tuple(change(s) for s in campaign.shots))


def _higher(campaign: Campaign) -> Campaign:
    return _of_shots(
        campaign, lambda s: dataclasses.replace(s, drop_height_m=s.drop_height_m + 1e-4)
    )


def _faster(campaign: Campaign) -> Campaign:
    return _of_shots(
        campaign, lambda s: dataclasses.replace(s, sample_rate_hz=s.sample_rate_hz * 1.0001)
    )


def _stronger(campaign: Campaign) -> Campaign:
    return dataclasses.replace(campaign, gravity_m_per_s2=campaign.gravity_m_per_s2 * 1.001)


@pytest.mark.parametrize(
    "shifted",
    [
        (lambda c: _heavier(c, ("acetal", "hdpe")), ("mass",), math.log(1.005)),
        (lambda c: _heavier(c, ("acetal",)), ("mass.acetal",), math.log(1.005)),
        (_larger, ("radius",), math.log(1.005)),
        (_higher, ("height_offset",), 0.1),
        (_faster, ("time_base",), 1e-4),
        (_stronger, ("gravity",), math.log(1.001)),
    ],
)
def test_sensitivities_are_what_a_fit_at_shifted_inputs_gives(
    made: tuple[Any, Campaign],
    exact: FitResult,
    believed: FitResult,
    shifted: Shifted,
) -> None:
    """Wrong masses, radii, heights, time base or g move the modulus as the fit says they do."""
    change, kinds, by = shifted
    starts = tuple(f"input.{kind}" for kind in kinds)
    promised = by * sum(s for n, s in sensitivities(believed).items() if n.startswith(starts))
    after = fit_campaign(change(made[1]), "kv", heldout=False)
    moved = log_modulus(after)[0] - log_modulus(exact)[0]
    assert moved == pytest.approx(promised, rel=0.03, abs=2e-6)


def test_a_wrong_input_moves_the_honest_fit_by_less_than_it_says(
    made: tuple[Any, Campaign], exact: FitResult
) -> None:
    """With stated uncertainties u grows, chi2 stays, and one u of every input stays within it."""
    fit = fit_campaign(honest(made[1]), "kv", heldout=False)
    assert log_modulus(fit)[1] > log_modulus(exact)[1]
    assert fit.chi2_per_dof == pytest.approx(exact.chi2_per_dof, abs=2e-3)
    assert fit.degrees_of_freedom == exact.degrees_of_freedom
    moved = fit_campaign(honest(_heavier(made[1], ("acetal",))), "kv", heldout=False)
    promised = sensitivities(fit)["input.mass.acetal"] * math.log(1.005)
    assert log_modulus(moved)[0] - log_modulus(fit)[0] == pytest.approx(promised, rel=0.05)
    u_mass = 5e-4
    assert abs(sensitivities(fit)["input.mass.acetal"] * u_mass) < log_modulus(fit)[1]


def test_a_converters_gain_moves_a_force_recordings_stiffness(
    made: tuple[Any, Campaign],
) -> None:
    """In a recording of force an error of the converter's gain is an error of the modulus."""
    rig, campaign = made
    newtons = rig.cell["crystal_stiffness"] * 1.2e-8
    shots = tuple(
        dataclasses.replace(s, signal=s.signal * newtons, quantity="force_N", u_gain_relative=1e-3)
        for s in campaign.shots
    )
    plain = tuple(dataclasses.replace(s, u_gain_relative=0.0) for s in shots)
    first = fit_campaign(dataclasses.replace(campaign, shots=plain), "kv", heldout=False)
    fit = fit_campaign(dataclasses.replace(campaign, shots=shots), "kv", heldout=False)
    assert [i.kind for i in fit.problem.inputs] == ["converter_gain"]
    assert log_modulus(fit)[1] > log_modulus(first)[1]


ISSUED = [
    (lambda c: _heavier(c, ("acetal", "hdpe", "acetal_small")), 4.9e-3),
    (lambda c: _heavier(c, ("acetal",)), 4.6e-3),
    (_larger, -2.4e-3),
    (lambda c: _of_shots(c, _half_a_millimetre_higher), -5.7e-3),
    (_faster, 2.5e-4),
]


def _half_a_millimetre_higher(shot: Any) -> Any:
    return dataclasses.replace(shot, drop_height_m=shot.drop_height_m + 5e-4)


def test_known_shifts_of_a_shared_campaign_are_inside_what_is_stated(shared_campaign: Any) -> None:
    """Wrong inputs move an exact fit as measured; with that u declared they stay within 2 u."""
    campaign, truth = shared_campaign("campaigns/clean")
    exact = fit_campaign(campaign, "kv", heldout=False)
    wide = declared(campaign, mass=5e-3, radius=5e-3, height_m=5e-4, rate=1e-4, g=1e-5)
    free = fit_campaign(wide, "kv", heldout=False)
    for change, known in ISSUED:
        moved = fit_campaign(change(campaign), "kv", heldout=False)
        assert log_modulus(moved)[0] - log_modulus(exact)[0] == pytest.approx(known, rel=0.03)
        assert moved.chi2_per_dof == pytest.approx(exact.chi2_per_dof, abs=5e-3)
        value, u = log_modulus(fit_campaign(change(wide), "kv", heldout=False))
        assert abs(value - log_modulus(free)[0]) < 2 * u
    found = fit_campaign(honest(campaign), "kv", heldout=False)
    low, high = found.moduli()["specimen"]["youngs_modulus_Pa"]["interval95"]
    assert low <= truth["specimen_youngs_modulus_Pa"] <= high
