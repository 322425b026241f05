"""Common errors of masses, radii and heights in the network of moduli over an archive."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from analysis import adjust_moduli, calibrate, fit_campaign, observation_from_fit
from analysis.campaign import Campaign, Quantity, Sensor, Sphere, Surface, Uncertainty
from analysis.fit.result import FitResult
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
        (pair,) = fit.pairs().values()
        whole = [x["d_ln_reduced_modulus_d_input"] * x["u"] for x in pair["inputs"].values()]
        common = sum(x**2 for x in whole) + one.u_calibration**2
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


def _by_hand(campaign: Campaign, mass_factor: float = 1.0) -> tuple[Campaign, Campaign]:
    """Return drops of acetal that calibrate, and one on the specimen from nobody knows what height.

    Without a height the shot's force rests on the calibration. Moduli are hardly known, so that no
    joint fit tells a mass by them.
    """

    def wide(known: Quantity | None) -> Quantity | None:
        return None if known is None else Quantity(known.value, 0.2 * known.value)

    ball = campaign.spheres["acetal"]
    mass = (ball.mass_kg or 0.0) * mass_factor
    ball = dataclasses.replace(
        ball,
        mass_kg=mass,
        youngs_modulus_pa=wide(ball.youngs_modulus_pa),
        u_mass_kg=Uncertainty(1e-2 * mass),
        u_radius_m=Uncertainty(1e-3 * (ball.radius_m or 0.0)),
    )
    surfaces = {
        n: dataclasses.replace(s, youngs_modulus_pa=wide(s.youngs_modulus_pa))
        for n, s in campaign.surfaces.items()
    }
    known = dataclasses.replace(campaign, spheres={"acetal": ball}, surfaces=surfaces)
    own = [s for s in known.shots if s.sphere == "acetal"]
    last = dataclasses.replace([s for s in own if s.surface == "specimen"][-1], drop_height_m=None)
    references = tuple(s for s in own if s.surface != "specimen")
    return dataclasses.replace(known, shots=references), dataclasses.replace(known, shots=(last,))


def _reduced(shot: Campaign, cell: Sensor) -> tuple[FitResult, float, float]:
    fit = fit_campaign(dataclasses.replace(shot, sensor=cell), "kv", by_pair=True, heldout=False)
    found = fit.pair_modulus(fit.shots[0].item)
    assert found is not None
    return fit, found[0], found[1]


def test_a_shot_shares_its_calibrations_errors(made: tuple[Any, Campaign]) -> None:
    """A sphere that calibrated the cell and is dropped again has one mass: E* follows it as a joint
    fit would, and as it does when the mass is written down wrong in both.
    """
    references, shot = _by_hand(made[1])
    cell = calibrate(references, "kv").sensor
    assert "input.mass.acetal" in cell.inputs
    fit, log, u = _reduced(shot, cell)
    _, _, blind_u = _reduced(shot, dataclasses.replace(cell, inputs={}))
    whole = dataclasses.replace(references, shots=(*references.shots, *shot.shots))
    joint = fit_campaign(whole, "kv", heldout=False)
    together = joint.pair_modulus(joint.shots[-1].item)
    assert together is not None
    assert u == pytest.approx(together[1], rel=0.15)
    assert blind_u > 1.4 * u
    (pair,) = fit.pairs().values()
    mass = pair["inputs"]["input.mass.acetal"]
    heavier, again = _by_hand(made[1], 1.01)
    shift = _reduced(again, calibrate(heavier, "kv").sensor)[1] - log
    told = mass["d_ln_reduced_modulus_d_input"] * math.log(1.01)
    assert shift == pytest.approx(told, rel=0.02)
    # the network is told the shot's own part, and adds what the calibration did
    seen = observation_from_fit(fit, shot="1", calibration="1")
    assert seen is not None
    own = seen.inputs["input.mass.acetal"]
    through = float(seen.sensitivity @ np.array(cell.inputs["input.mass.acetal"]))
    assert own == pytest.approx(1.5 * 0.01, rel=0.02)
    assert own + through == pytest.approx(mass["d_ln_reduced_modulus_d_input"] * 0.01, rel=1e-6)


def test_the_cell_is_as_uncertain_as_its_calibration_left_it(made: tuple[Any, Campaign]) -> None:
    """Taking the shared errors apart does not change what is said of the cell before a shot."""
    references, shot = _by_hand(made[1])
    cell = calibrate(references, "kv").sensor
    fit, _, _ = _reduced(shot, cell)
    logs = fit.sensor_logs()
    assert logs is not None
    assert cell.covariance is not None
    before, after = np.sqrt(np.diag(cell.covariance)), np.sqrt(np.diag(logs[1]))
    assert np.all(after < 1.001 * before)
    assert after[0] == pytest.approx(before[0], rel=0.05)  # the crystal's mass: no shot tells it
    told = fit.to_json()["covariance"]
    at = told["names"].index("sensor.ln_S")
    gain = fit.parameters()["sensor.gain_N_per_V"]
    assert math.sqrt(told["matrix"][at][at]) == pytest.approx(gain["u"] / gain["value"], rel=1e-9)
