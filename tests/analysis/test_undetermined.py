"""Moduli that no quieter record would tell: which, what is missing, what to add."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Quantity, Sensor, Sphere
from analysis.fit.result import FitResult


def _fit(campaign: Campaign) -> FitResult:
    return fit_campaign(campaign, "kv", heldout=False)


def _of_pair(truth: Any, unknown: tuple[str, ...], noise_v: float = 1.5e-3) -> Campaign:
    rig = truth(seed=41, noise_v=noise_v)
    campaign: Campaign = rig.campaign(
        pairs=(("acetal", "specimen"),), heights_m=(0.015, 0.05), unknown=unknown
    )
    return campaign


def _with_sphere(campaign: Campaign, **changes: Any) -> Campaign:
    """Return a campaign whose spheres are stated differently."""
    spheres = {n: dataclasses.replace(s, **changes) for n, s in campaign.spheres.items()}
    return dataclasses.replace(campaign, spheres=spheres)


@pytest.mark.parametrize("noise_v", [1.5e-3, 1.5e-6])
def test_a_pair_without_a_stated_modulus_tells_neither(truth: Any, noise_v: float) -> None:
    """Both moduli are withheld with what to add, and a thousand times less noise is no help."""
    fit = _fit(_of_pair(truth, ("acetal", "specimen"), noise_v))
    assert [(one.side, one.material, one.missing) for one in fit.undetermined] == [
        ("sphere", "acetal", "reference"),
        ("surface", "specimen", "reference"),
    ]
    specimen = fit.moduli()["specimen"]
    assert specimen["status"] == "withheld"
    assert "State the modulus of acetal" in specimen["reason"]
    assert "a sphere of stated modulus on specimen" in specimen["reason"]
    json.dumps(fit.to_json(), allow_nan=False)


def test_one_stated_modulus_is_enough(truth: Any) -> None:
    """With the sphere stated nothing is open, and the specimen's modulus is given."""
    fit = _fit(_of_pair(truth, ("specimen",)))
    assert fit.undetermined == []
    assert fit.moduli()["specimen"]["status"] == "fitted"


def test_a_statement_that_says_next_to_nothing_is_none(truth: Any) -> None:
    """A sphere known to a factor of two leaves the specimen as open as one that is not known."""
    campaign = _of_pair(truth, ("specimen",))
    wide = _with_sphere(campaign, youngs_modulus_pa=Quantity(3.15e9, 2.5e9))
    (one,) = _fit(wide).undetermined
    assert (one.material, one.missing) == ("specimen", "reference")


def test_a_reference_reaches_through_the_network(made: tuple[Any, Campaign]) -> None:
    """One stated surface tells both spheres, and through them the specimen."""
    _, campaign = made
    spheres = _with_sphere(campaign, youngs_modulus_pa=None)
    assert _fit(spheres).undetermined == []


def test_volts_without_gain_or_height_give_no_modulus(made: tuple[Any, Campaign]) -> None:
    """Nothing turns volts into newtons, so no modulus is made up from volts taken as newtons."""
    _, campaign = made
    shots = tuple(dataclasses.replace(s, drop_height_m=None) for s in campaign.shots)
    fit = _fit(dataclasses.replace(campaign, shots=shots, sensor=Sensor()))
    assert [(one.material, one.missing) for one in fit.undetermined] == [("specimen", "gain")]
    assert set(fit.moduli()) == {"specimen"}
    assert fit.moduli()["specimen"]["status"] == "withheld"
    assert "drop heights" in fit.moduli()["specimen"]["reason"]
    assert all("stiffness_over_mass" in pair for pair in fit.pairs().values())


def test_a_sphere_without_radius_gives_no_modulus(made: tuple[Any, Campaign]) -> None:
    """In reduced units a modulus that was asked for is withheld with what to state."""
    fit = _fit(_with_sphere(made[1], radius_m=None))
    (one,) = fit.undetermined
    assert (one.material, one.missing) == ("specimen", "sphere")
    assert "State the radius" in one.sentence


def test_recordings_of_strangers_ask_for_no_modulus(made: tuple[Any, Campaign]) -> None:
    """Where no modulus and no Poisson's ratio is stated nobody asks for one, and none is missed."""
    _, campaign = made
    spheres = {n: Sphere(n, radius_m=s.radius_m) for n, s in campaign.spheres.items()}
    surfaces = {
        n: dataclasses.replace(s, youngs_modulus_pa=None, poissons_ratio=None)
        for n, s in campaign.surfaces.items()
    }
    bare = dataclasses.replace(campaign, spheres=spheres, surfaces=surfaces, sensor=Sensor())
    fit = _fit(bare)
    assert fit.undetermined == []
    assert fit.moduli() == {}


def test_a_sphere_without_mass_is_fitted_in_reduced_units(made: tuple[Any, Campaign]) -> None:
    """A height promises no speed in units of the volts, so that it cannot bend the fit."""
    fit = _fit(_with_sphere(made[1], mass_kg=None))
    assert [(one.material, one.missing) for one in fit.undetermined] == [("specimen", "sphere")]
    assert fit.nrmse < 1e-2
