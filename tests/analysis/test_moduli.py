"""The network of moduli on exact and noisy observations, with references and contradictions."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from analysis import (
    AnalysisError,
    PairObservation,
    adjust_moduli,
    calibrate,
    fit_campaign,
    observation_from_fit,
)
from analysis.campaign import Quantity, Sphere, Surface

RATIO = Quantity(0.36, 0.0)
TRUE = {"a": 3.2e9, "b": 1.2e9, "s": 70e9, "p": 2.4e9, "x": 1.6e9}  # E'
SPHERES, SURFACES = ("a", "b"), ("s", "p", "x")


def _materials(*references: str, u: float = 0.02) -> tuple[dict[str, Sphere], dict[str, Surface]]:
    def stated(name: str) -> Quantity | None:
        young = TRUE[name] * (1 - RATIO.value**2)
        return Quantity(young, u * young) if name in references else None

    return (
        {n: Sphere(n, 4.76e-3, 6e-4, stated(n), RATIO) for n in SPHERES},
        {n: Surface(n, stated(n), RATIO) for n in SURFACES},
    )


def _observe(
    pairs: list[tuple[str, str]],
    *,
    u: float = 1e-4,
    common: float = 0.0,
    seed: int | None = None,
    repeats: int = 1,
) -> list[PairObservation]:
    rng = np.random.default_rng(seed)
    found = []
    for i, (sphere, surface) in enumerate(pairs * repeats):
        log = -math.log(1 / TRUE[sphere] + 1 / TRUE[surface])
        error = u * rng.standard_normal() if seed is not None else 0.0
        found.append(
            PairObservation(
                sphere,
                surface,
                log + common + error,
                u,
                np.array([0.0, 0.0, 0.0, 1.0]),
                f"shot {i}",
                "kv",
                0.01,
                "c1",
            )
        )
    return found


ALL = [(s, f) for s in SPHERES for f in SURFACES]


def test_one_reference_fixes_every_modulus() -> None:
    """With all pairs and one exactly known material exact observations give exact moduli."""
    result = adjust_moduli(_observe(ALL), *_materials("a", u=1e-6))
    for name in result.names:
        log, u = result.plane_strain(name)
        error = log - math.log(TRUE[name.partition(".")[2]])
        assert abs(error) < max(0.2 * u, 1e-4), name
    assert result.network.p_value is not None
    assert result.network.p_value > 0.9
    assert result.contradicting == ()
    assert result.dark_u == 0.0


def test_two_spheres_alone_cannot_tell_absolute_moduli() -> None:
    """Without any reference everything is withheld and the remedy is named."""
    found = adjust_moduli(_observe(ALL), *_materials()).to_json()
    for entry in found["moduli"].values():
        assert entry["status"] == "withheld"
        assert entry["youngs_modulus_Pa"] is None
        assert "reference" in entry["reason"]


def test_only_the_part_without_reference_is_withheld() -> None:
    """A pair that shares no material with a reference is withheld; the others are stated."""
    found = adjust_moduli(_observe([("a", "p"), ("b", "x")]), *_materials("p")).to_json()
    assert found["moduli"]["a"]["status"] == "fitted"
    assert found["moduli"]["p"]["status"] == "reference"
    assert {found["moduli"][n]["status"] for n in ("b", "x")} == {"withheld"}
    assert any("redundant" in w for w in found["warnings"])


def test_repeats_average_the_noise_but_not_the_calibration() -> None:
    """A hundred repeats leave the calibration's uncertainty whole."""
    once = adjust_moduli(_observe([("a", "x")], u=5e-3), *_materials("a", u=1e-6))
    many = adjust_moduli(_observe([("a", "x")], u=5e-3, repeats=100), *_materials("a", u=1e-6))
    slope = 1 + TRUE["x"] / TRUE["a"]  # d ln E'_x / d ln E*
    assert once.plane_strain("surface.x")[1] == pytest.approx(
        slope * math.hypot(5e-3, 0.01), rel=1e-2
    )
    assert many.plane_strain("surface.x")[1] == pytest.approx(
        slope * math.hypot(5e-4, 0.01), rel=1e-2
    )


def test_covariance_of_the_cell_replaces_the_plain_calibration_part() -> None:
    """With the cell's covariance the common error goes along the sensitivities."""
    covariance = np.diag([1e-2, 1e-2, 1e-2, 0.004**2])
    result = adjust_moduli(_observe([("a", "x")], repeats=50), *_materials("a", u=1e-6), covariance)
    slope = 1 + TRUE["x"] / TRUE["a"]
    assert result.plane_strain("surface.x")[1] == pytest.approx(slope * 0.004, rel=1e-2)


def test_references_pull_a_common_error_out() -> None:
    """References that disagree with the gain by one u correct the calibration for all pairs."""
    observed = _observe(ALL, common=0.01)
    result = adjust_moduli(observed, *_materials("a", "b", "s", "p", u=1e-3))
    log, u = result.plane_strain("surface.x")
    assert abs(math.exp(log) / TRUE["x"] - 1) < 0.004
    assert u < 0.006


def test_two_calibrations_have_two_common_errors() -> None:
    """Shots under two calibrations average their calibrations' errors."""
    first = _observe([("a", "x")], repeats=20)
    second = [dataclasses.replace(o, calibration="c2") for o in first]
    one = adjust_moduli(first, *_materials("a", u=1e-6)).plane_strain("surface.x")[1]
    two = adjust_moduli(first + second, *_materials("a", u=1e-6)).plane_strain("surface.x")[1]
    assert two == pytest.approx(one / math.sqrt(2), rel=1e-2)


def test_stated_uncertainties_cover_the_errors() -> None:
    """Over many noisy networks normalised errors have unit spread and chi2 its expectation."""
    scores, excess = [], []
    rng = np.random.default_rng(3)
    spheres, surfaces = _materials("a", "p", u=0.01)
    for seed in range(60):
        drawn_s = {n: _drawn(m, rng) for n, m in spheres.items()}
        drawn_f = {n: _drawn(m, rng) for n, m in surfaces.items()}
        observed = _observe(ALL, u=3e-3, common=0.01 * rng.standard_normal(), seed=seed, repeats=3)
        result = adjust_moduli(observed, drawn_s, drawn_f)
        for name in result.names:
            log, u = result.plane_strain(name)
            scores.append((log - math.log(TRUE[name.partition(".")[2]])) / u)
        excess.append(result.network.chi2 / result.network.degrees_of_freedom)
    assert np.std(scores) == pytest.approx(1.0, abs=0.15)
    assert np.mean(excess) == pytest.approx(1.0, abs=0.1)


def _drawn(material: Any, rng: np.random.Generator) -> Any:
    q = material.youngs_modulus_pa
    if q is None:
        return material
    moved = Quantity(q.value * math.exp(q.u / q.value * rng.standard_normal()), q.u)
    return dataclasses.replace(material, youngs_modulus_pa=moved)


def test_a_pair_that_contradicts_is_named_and_no_other() -> None:
    """One pair 5 % off is named; its sound neighbours are not, and uncertainties grow."""
    observed = _observe(ALL, u=2e-3, seed=4, repeats=5)
    bad = [
        dataclasses.replace(o, log_reduced_modulus=o.log_reduced_modulus + 0.05)
        if o.pair == "b/p"
        else o
        for o in observed
    ]
    sound = adjust_moduli(observed, *_materials("a", "s"))
    found = adjust_moduli(bad, *_materials("a", "s"))
    assert sound.contradicting == ()
    assert found.contradicting == ("b/p",)
    assert found.dark_u > 5e-3
    assert found.plane_strain("surface.x")[1] > sound.plane_strain("surface.x")[1]
    warnings = found.to_json()["warnings"]
    assert any("b/p contradicts" in w and "+" in w for w in warnings)


def test_young_needs_poissons_ratio() -> None:
    """A material without a stated ratio gets its plane-strain modulus and a reason, no E."""
    spheres, surfaces = _materials("a")
    surfaces["x"] = dataclasses.replace(surfaces["x"], poissons_ratio=None)
    entry = adjust_moduli(_observe([("a", "x")]), spheres, surfaces).to_json()["moduli"]["x"]
    assert entry["youngs_modulus_Pa"] is None
    assert entry["plane_strain_modulus_Pa"]["value"] == pytest.approx(TRUE["x"], rel=0.01)
    assert "Poisson" in entry["reason"]


def test_poissons_uncertainty_reaches_young_only() -> None:
    """The ratio's uncertainty widens E and leaves E' alone."""
    spheres, surfaces = _materials("a", u=1e-4)
    surfaces["x"] = dataclasses.replace(surfaces["x"], poissons_ratio=Quantity(0.36, 0.03))
    result = adjust_moduli(_observe([("a", "x")], repeats=10), spheres, surfaces)
    entry = result.to_json()["moduli"]["x"]
    plane, young = entry["plane_strain_modulus_Pa"], entry["youngs_modulus_Pa"]
    expected = math.hypot(plane["u"] / plane["value"], 2 * 0.36 * 0.03 / (1 - 0.36**2))
    assert young["u"] / young["value"] == pytest.approx(expected, rel=1e-6)


def test_same_name_on_both_sides_is_kept_apart() -> None:
    """A sphere and a surface of one name are two materials, and the keys say which is which."""
    spheres, surfaces = _materials("a")
    surfaces["a"] = Surface("a", None, RATIO)
    observed = [
        *_observe([("a", "x")]),
        dataclasses.replace(_observe([("a", "x")])[0], surface="a"),
    ]
    found = adjust_moduli(observed, spheres, surfaces).to_json()["moduli"]
    assert {"sphere:a", "surface:a", "x"} == set(found)


def test_what_cannot_be_adjusted_is_refused() -> None:
    """No observation, mixed models, unknown materials and a foreign covariance are errors."""
    materials = _materials("a")
    observed = _observe([("a", "x")])
    with pytest.raises(AnalysisError, match="fit some shots"):
        adjust_moduli([], *materials)
    mixed = [*observed, dataclasses.replace(observed[0], model="hsd")]
    with pytest.raises(AnalysisError, match="hsd, kv"):
        adjust_moduli(mixed, *materials)
    with pytest.raises(AnalysisError, match="'y'"):
        adjust_moduli([dataclasses.replace(observed[0], surface="y")], *materials)
    with pytest.raises(AnalysisError, match="another model"):
        adjust_moduli(observed, *materials, np.eye(1))


def test_from_recordings_to_moduli(made: Any) -> None:
    """Single-shot fits under a calibration, adjusted together, cover the specimen's truth."""
    rig, campaign = made
    sensor = calibrate(campaign, "kv").sensor
    observed = []
    for shot in campaign.shots:
        one = dataclasses.replace(campaign, shots=(shot,), sensor=sensor)
        fit = fit_campaign(one, "kv", by_pair=True, heldout=False)
        found = observation_from_fit(fit.to_json(), shot=shot.name, calibration="1")
        assert found is not None
        modulus = fit.pair_modulus(fit.shots[0].item)
        assert modulus is not None
        assert found.log_reduced_modulus == pytest.approx(modulus[0], abs=1e-12)
        assert math.hypot(found.u_random, found.u_calibration) == pytest.approx(modulus[1])
        observed.append(found)
    result = adjust_moduli(observed, campaign.spheres, campaign.surfaces, sensor.covariance)
    assert result.contradicting == ()
    found = result.to_json()
    json.dumps(found, allow_nan=False)
    low, high = found["moduli"]["specimen"]["youngs_modulus_Pa"]["interval95"]
    assert low <= rig.moduli["specimen"][0] <= high
    assert found["covariance"]["names"] == list(result.names)
    assert found["calibrations"] == ["1"]


def test_fits_without_moduli_give_no_observation() -> None:
    """A fit that failed or is in reduced units adds nothing to the network."""
    failed = {"outcome": {"status": "not_converged", "message": ""}, "pairs": {}, "model": "kv"}
    assert observation_from_fit(failed, shot="1") is None
    reduced = {
        "outcome": {"status": "converged", "message": ""},
        "model": "kv",
        "pairs": {"?/?": {"sphere": None, "surface": None, "stiffness_over_mass": {"value": 1.0}}},
    }
    assert observation_from_fit(reduced, shot="1") is None
