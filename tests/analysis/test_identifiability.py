"""The report on what the shots fix and what they do not."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Quantity, Sensor
from analysis.fit.result import FitResult


@pytest.fixture(scope="module")
def network(made: tuple[Any, Campaign]) -> FitResult:
    """Return the fit of two spheres on two surfaces."""
    return fit_campaign(made[1], "kv", heldout=False)


def _one_pair(truth: Any, unknown: tuple[str, ...]) -> FitResult:
    rig = truth(seed=41)
    campaign = rig.campaign(
        pairs=(("acetal", "specimen"),), heights_m=(0.015, 0.03, 0.06), unknown=unknown
    )
    return fit_campaign(campaign, "kv", heldout=False)


def test_combinations_are_fixed_by_the_shots(network: FitResult) -> None:
    """omega0, zeta, S and every pair's K come from the shots, far sharper than was stated."""
    report = network.identifiability()
    for name in (
        "sensor.natural_frequency_Hz",
        "sensor.damping_ratio",
        "sensor.gain_N_per_V",
        "pair.acetal/polycarbonate",
        "pair.hdpe/specimen",
    ):
        found = report.finding(name)
        assert found.status == "shots", name
        assert found.u_prior is None or found.u < 0.1 * found.u_prior
        assert found.u_shots == pytest.approx(found.u, rel=0.01)


def test_the_crystals_single_numbers_are_the_certificates(network: FitResult) -> None:
    """M, k, mu and c are called what was stated: the four certificates share one open direction."""
    report = network.identifiability()
    for name in ("crystal_mass_kg", "crystal_stiffness_n_per_m", "compliance_m_per_v"):
        found = report.finding(f"sensor.{name}")
        assert found.status == "prior", name
        assert found.u_prior is not None
        assert found.u > 0.7 * found.u_prior
    (sentence,) = [s for s in report.sentences() if "crystal's mass" in s]
    assert "recoil" in sentence


def test_without_a_certificate_only_the_recoil_weighs_the_crystal(
    made: tuple[Any, Campaign],
) -> None:
    """Nobody said what the crystal weighs: drops tell it a hundred times worse than the gain."""
    fit = fit_campaign(dataclasses.replace(made[1], sensor=Sensor()), "kv", heldout=False)
    report = fit.identifiability()
    mass, gain = (report.finding(f"sensor.{n}") for n in ("crystal_mass_kg", "gain_N_per_V"))
    assert mass.u_prior is None
    assert gain.status == "shots"
    assert mass.u > 20 * gain.u
    assert any("recoil" in s for s in report.sentences())


def test_one_pair_does_not_split(truth: Any) -> None:
    """One pair with both moduli open gives K, and neither E; profile and words agree."""
    fit = _one_pair(truth, ("acetal", "specimen"))
    report = fit.identifiability(profiled=["surface.specimen"])
    assert report.finding("pair.acetal/specimen").status == "shots"
    assert report.finding("sphere.acetal").status == "not_identifiable"
    assert report.finding("surface.specimen").status == "not_identifiable"
    (split,) = report.splits
    assert split.determined_by == "nothing"
    assert any("one number for the pair" in s and "reference" in s for s in report.sentences())
    (found,) = report.profiles
    assert found.high is None or found.high - fit.fitted.theta[-1] > 1.0
    assert [x[:2] for x in report.correlated()] == [("sphere.acetal", "surface.specimen")]


def test_a_stated_sphere_splits_one_pair_by_its_statement(truth: Any) -> None:
    """With the sphere stated the surface follows, and the report says whose word it rests on."""
    report = _one_pair(truth, ("specimen",)).identifiability()
    (split,) = report.splits
    assert (split.determined_by, split.stated) == ("stated", ("acetal",))
    assert report.finding("sphere.acetal").status == "prior"
    assert any("follows from the stated acetal" in s for s in report.sentences())


def test_a_network_splits_its_pairs(network: FitResult) -> None:
    """Two spheres on two surfaces: no pair's split hangs on its own two statements alone."""
    assert {s.determined_by for s in network.identifiability().splits} == {"network"}


def test_split_is_what_brute_force_says(truth: Any) -> None:
    """The reported u of the split is that of a fit in which the two statements are taken away."""
    rig = truth(seed=41)
    campaign = rig.campaign(heights_m=(0.02, 0.05))
    report = fit_campaign(campaign, "kv", heldout=False).identifiability()
    free = dataclasses.replace(
        campaign,
        spheres=campaign.spheres
        | {"acetal": dataclasses.replace(campaign.spheres["acetal"], youngs_modulus_pa=None)},
        surfaces=campaign.surfaces
        | {
            "polycarbonate": dataclasses.replace(
                campaign.surfaces["polycarbonate"], youngs_modulus_pa=None
            )
        },
    )
    again = fit_campaign(free, "kv", heldout=False)
    i, j = (again.problem.names.index(n) for n in ("sphere.acetal", "surface.polycarbonate"))
    c = again.fitted.covariance
    u = math.sqrt(c[i, i] + c[j, j] - 2 * c[i, j])
    split = next(s for s in report.splits if s.pair == "acetal/polycarbonate")
    assert split.u_open == pytest.approx(u, rel=0.05)


def test_poissons_ratio_is_never_identifiable(network: FitResult) -> None:
    """The report says so, and what the stated ratio costs the modulus."""
    found = network.to_json()["identifiability"]["poissons_ratio"]
    assert found["status"] == "never"
    nu = network.problem.campaign.surfaces["specimen"].poissons_ratio
    assert nu is not None
    assert found["u_ln_modulus"]["specimen"] == pytest.approx(
        2 * nu.value * nu.u / (1 - nu.value**2)
    )


@pytest.mark.parametrize("by_pair", [True, False])
def test_steel_on_steel_is_not_identifiable(truth: Any, by_pair: bool) -> None:
    """A contact of a third of the crystal's period is refused in words, status and flag."""
    rig = truth(seed=5)
    rig.moduli |= {"steel": (194e9, 0.33), "plate": (200e9, 0.29)}
    rig.spheres["steel"] = (2.99e-3, 0.878e-3)
    campaign = rig.campaign(pairs=(("steel", "plate"),), heights_m=(0.02, 0.05), unknown=("plate",))
    fit = fit_campaign(campaign, "kv", by_pair=by_pair, heldout=False)
    report = fit.identifiability()
    assert report.finding("pair.steel/plate").status == "not_identifiable"
    assert "contact_law_not_identifiable" in fit.flags()
    assert any(s.startswith("steel/plate: not identifiable") for s in report.sentences())
    if not by_pair:
        assert report.finding("surface.plate").status == "not_identifiable"


def test_information_and_priors_make_the_covariance(network: FitResult) -> None:
    """Fisher information plus the priors' precision is the inverse of the covariance."""
    found = network.to_json()["identifiability"]["fisher_information"]
    assert found["names"] == network.problem.names
    total = np.array(found["matrix"]) + network.problem.prior_precision
    u = np.sqrt(np.diag(network.fitted.covariance))
    identity = (total @ network.fitted.covariance) / u * u[:, None]
    np.testing.assert_allclose(identity, np.eye(u.size), atol=1e-5)


def test_uncertainty_of_the_shots_is_the_gain_over_the_prior(truth: Any) -> None:
    """A modulus stated twice as sharply changes its own u, not what the shots say about it."""
    rig = truth(seed=43)
    campaign = rig.campaign(heights_m=(0.02, 0.05))

    def stated(u: float) -> FitResult:
        value = campaign.spheres["hdpe"].youngs_modulus_pa
        assert value is not None
        sphere = dataclasses.replace(
            campaign.spheres["hdpe"], youngs_modulus_pa=Quantity(value.value, u * value.value)
        )
        return fit_campaign(
            dataclasses.replace(campaign, spheres=campaign.spheres | {"hdpe": sphere}),
            "kv",
            heldout=False,
        )

    wide, sharp = (stated(u).identifiability().finding("sphere.hdpe") for u in (0.02, 0.01))
    assert wide.u_shots is not None
    assert wide.u_shots == pytest.approx(sharp.u_shots, rel=0.05)
    assert sharp.u < wide.u


def test_report_is_json(network: FitResult) -> None:
    """The whole report survives JSON without NaN, and every quantity has its sentence."""
    report = network.identifiability(profiled=["sensor.ln_M"])
    text = json.loads(json.dumps(report.to_json(), allow_nan=False))
    assert all(q["sentence"].endswith(".") for q in text["quantities"])
    assert text["profiles"][0]["interval95"][0] < text["profiles"][0]["interval95"][1]
    assert "identifiability" in network.to_json()


def test_rigid_cell_reports_too(made: tuple[Any, Campaign]) -> None:
    """HSD has a gain and moduli, and its report speaks of no crystal."""
    report = fit_campaign(made[1], "hsd", heldout=False).identifiability()
    names = [f.asked.name for f in report.findings]
    assert "sensor.gain_N_per_V" in names
    assert not any("crystal" in n or "frequency" in n for n in names)
