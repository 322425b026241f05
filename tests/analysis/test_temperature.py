"""Stated moduli at the temperature of the shots."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Environment, Quantity
from analysis.fit.problem import build
from analysis.model.impact_model import model_named
from analysis.temperature import at_temperature_of_shots

COEFFICIENT = Quantity(-5e-3, 1e-3)


def _with_coefficient(campaign: Campaign, temperature: Quantity | None) -> Campaign:
    """Return a campaign whose acetal softens by half a per cent a kelvin from 23 degC on."""
    acetal = dataclasses.replace(campaign.spheres["acetal"], modulus_coefficient_per_k=COEFFICIENT)
    around = None if temperature is None else Environment(temperature)
    return dataclasses.replace(
        campaign, spheres=campaign.spheres | {"acetal": acetal}, environment=around
    )


def test_a_modulus_is_taken_at_the_temperature_of_its_shots(made: tuple[Any, Campaign]) -> None:
    """Ten kelvins move it by e^(-0.05), and thermometer and coefficient widen it."""
    campaign = made[1]
    stated = campaign.spheres["acetal"].youngs_modulus_pa
    assert stated is not None
    moved, told = at_temperature_of_shots(_with_coefficient(campaign, Quantity(33.0, 1.0)))
    found = moved.spheres["acetal"].youngs_modulus_pa
    assert found is not None
    assert told == ()
    assert found.value == pytest.approx(stated.value * math.exp(-0.05))
    relative = math.sqrt((stated.u / stated.value) ** 2 + (5e-3 * 1.0) ** 2 + (10 * 1e-3) ** 2)
    assert found.u == pytest.approx(relative * found.value)
    assert moved.spheres["hdpe"] == campaign.spheres["hdpe"]
    assert at_temperature_of_shots(moved) == (moved, ())


def test_shots_know_better_than_the_campaign(made: tuple[Any, Campaign]) -> None:
    """A shot's own temperature counts, and the spread of the shots is a part of u."""
    campaign = _with_coefficient(made[1], Quantity(23.0, 0.1))
    shots = tuple(
        dataclasses.replace(s, environment=Environment(Quantity(27.0 + 2 * (i % 2), 0.1)))
        for i, s in enumerate(campaign.shots)
    )
    moved, _ = at_temperature_of_shots(dataclasses.replace(campaign, shots=shots))
    found = moved.spheres["acetal"].youngs_modulus_pa
    stated = campaign.spheres["acetal"].youngs_modulus_pa
    assert found is not None
    assert stated is not None
    assert math.log(found.value / stated.value) == pytest.approx(-5e-3 * 5.0, rel=0.1)
    relative = math.sqrt(
        (stated.u / stated.value) ** 2 + (5e-3 * math.hypot(1.0, 0.1)) ** 2 + (5 * 1e-3) ** 2
    )
    assert found.u / found.value == pytest.approx(relative, rel=0.02)


def test_an_unknown_temperature_is_told(made: tuple[Any, Campaign]) -> None:
    """A coefficient that nothing can be done with is an assumption; the modulus is as stated."""
    campaign = made[1]
    problem = build(_with_coefficient(campaign, None), model_named("kv"))
    (told,) = [one for one in problem.assumptions if "temperature" in one]
    assert "sphere acetal" in told
    assert "23 degC" in told
    assert "-0.5 % per kelvin" in told
    known = problem.campaign.spheres["acetal"].youngs_modulus_pa
    assert known == campaign.spheres["acetal"].youngs_modulus_pa
    plain = build(campaign, model_named("kv"))
    assert not [one for one in plain.assumptions if "temperature" in one]


def test_the_fit_starts_from_the_moved_modulus(made: tuple[Any, Campaign]) -> None:
    """A reference that is warmer than its data sheet does not bend the others' moduli."""
    rig, campaign = made
    softened = math.exp(COEFFICIENT.value * 40.0)
    cold = campaign.spheres["acetal"].youngs_modulus_pa
    assert cold is not None
    # the data sheet's value of a ball that has, at 63 degC, the modulus of the records
    sheet = Quantity(cold.value / softened, cold.u / softened)
    acetal = dataclasses.replace(campaign.spheres["acetal"], youngs_modulus_pa=sheet)
    stated = dataclasses.replace(campaign, spheres=campaign.spheres | {"acetal": acetal})
    warm = fit_campaign(_with_coefficient(stated, Quantity(63.0, 0.5)), "kv", heldout=False)
    low, high = warm.moduli()["acetal"]["youngs_modulus_Pa"]["interval95"]
    assert low <= rig.moduli["acetal"][0] <= high
    assert warm.conflicts == []
