"""Common errors of masses, radii and heights in the network of moduli over an archive."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from analysis import adjust_moduli, calibrate, fit_campaign, observation_from_fit
from analysis.campaign import Campaign, Quantity, Sphere, Surface, Uncertainty
from analysis.pair_observation import PairObservation

RATIO = Quantity(0.36, 0.0)
SPHERES = {"a": Sphere("a", None, None, Quantity(3e9, 3e4), RATIO)}
SURFACES = {"x": Surface("x", None, RATIO)}


def _observed(shot: int, calibration: str, inputs: dict[str, float]) -> PairObservation:
    return PairObservation(
        sphere="a",
        surface="x",
        log_reduced_modulus=math.log(1e9),
        u_random=1e-3,
        sensitivity=np.array([1.0]),
        shot=f"shot {shot}",
        model="hsd",
        calibration=calibration,
        inputs=inputs,
    )


def _u(observations: list[PairObservation], **known: Any) -> float:
    result = adjust_moduli(observations, SPHERES, SURFACES, **known)
    return result.plane_strain("surface.x")[1]


def test_no_number_of_shots_averages_a_mass_away() -> None:
    """A common input error stays as it is, whatever calibrations the shots were taken under."""
    sure = {"1": np.array([[1e-12]]), "2": np.array([[1e-12]])}
    shots = [_observed(i, "12"[i % 2], {"input.mass.a": 5e-3}) for i in range(400)]
    bare = [dataclasses.replace(o, inputs={}) for o in shots]
    follows = 1 / (1 - 1e9 / (3e9 / (1 - RATIO.value**2)))
    assert _u(shots, sensor_covariance=sure) == pytest.approx(5e-3 * follows, rel=0.02)
    assert _u(bare, sensor_covariance=sure) < 0.1 * _u(shots, sensor_covariance=sure)


def test_a_calibration_with_the_same_sphere_shares_its_error() -> None:
    """What a wrong mass does to the calibration adds to what it does to the shots, by sign."""
    cell = {"1": np.array([[1e-4]])}
    shots = [_observed(i, "1", {"input.mass.a": 5e-3}) for i in range(400)]
    against = {"1": {"input.mass.a": np.array([-5e-3])}}
    along = {"1": {"input.mass.a": np.array([5e-3])}}
    apart = _u(shots, sensor_covariance=cell)
    assert _u(shots, sensor_covariance=cell, calibrated_by=against) < apart
    assert _u(shots, sensor_covariance=cell, calibrated_by=along) > apart


def test_single_fits_and_calibrations_carry_their_inputs(made: tuple[Any, Campaign]) -> None:
    """Each shot's fit says how it follows its inputs, and the network's u grows by them."""
    campaign = made[1]
    spheres = {
        n: dataclasses.replace(
            s,
            u_mass_kg=Uncertainty(5e-3 * (s.mass_kg or 0.0)),
            u_radius_m=Uncertainty(5e-3 * (s.radius_m or 0.0)),
        )
        for n, s in campaign.spheres.items()
    }
    known = dataclasses.replace(campaign, spheres=spheres, u_height_offset_m=Uncertainty(3e-4))
    references = dataclasses.replace(
        known, shots=tuple(s for s in known.shots if s.surface != "specimen")
    )
    calibration = calibrate(references, "kv")
    said = calibration.to_json()["inputs"]
    assert {"input.mass.acetal", "input.radius.hdpe", "input.height_offset"} <= set(said)
    cell = calibration.sensor
    rest = [s for s in known.shots if s.surface == "specimen"]
    fits = [
        fit_campaign(
            dataclasses.replace(known, shots=(s,), sensor=cell), "kv", by_pair=True, heldout=False
        )
        for s in rest
    ]
    seen = [observation_from_fit(f, shot=f.shots[0].item.shot.name, calibration="1") for f in fits]
    observations = [o for o in seen if o is not None]
    assert len(observations) == len(rest)
    for fit, one in zip(fits, observations, strict=True):
        (modulus,) = [fit.pair_modulus(s.item) for s in fit.shots]
        assert modulus is not None
        assert f"input.mass.{one.sphere}" in one.inputs
        common = sum(x**2 for x in one.inputs.values()) + one.u_calibration**2
        assert one.u_random**2 + common == pytest.approx(modulus[1] ** 2, rel=1e-9)
    assert cell.covariance is not None
    by = {"1": {name: np.array(x) for name, x in said.items()}}
    bare = [dataclasses.replace(o, inputs={}) for o in observations]
    args = (known.spheres, known.surfaces, {"1": cell.covariance})
    whole = adjust_moduli(observations, *args, by).plane_strain("surface.specimen")
    without = adjust_moduli(bare, *args).plane_strain("surface.specimen")
    assert whole[1] != without[1]
    assert 0.0 < whole[1] < 0.1
    assert abs(whole[0] - without[0]) < 3 * whole[1]
