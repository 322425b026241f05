"""Shots that contradict a statement: who it is, and which moduli are stated all the same."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Quantity
from analysis.diagnosis.document.diagnosis_json import _block, _provisos
from analysis.diagnosis.document.moduli_stated import withhold_sought
from analysis.fit.result import FitResult


def _withheld(result: FitResult) -> dict[str, Any]:
    """Return the specimen's modulus of a fit that leaves structure."""
    block = _block(result)
    withhold_sought(block, result)
    specimen: dict[str, Any] = block["moduli"]["specimen"]
    return specimen


def _misstated(made: tuple[Any, Campaign], relative_u: float) -> Campaign:
    """Return a campaign of spheres known so well, whose polycarbonate is stated 40 % too high."""
    rig, campaign = made
    spheres = {
        n: dataclasses.replace(
            s,
            youngs_modulus_pa=Quantity(rig.moduli[n][0], relative_u * rig.moduli[n][0]),
            poissons_ratio=Quantity(rig.moduli[n][1], relative_u),
        )
        for n, s in campaign.spheres.items()
    }
    coupon = campaign.surfaces["polycarbonate"]
    said = coupon.youngs_modulus_pa
    assert said is not None
    wrong = dataclasses.replace(coupon, youngs_modulus_pa=Quantity(1.4 * said.value, 1.4 * said.u))
    surfaces = campaign.surfaces | {"polycarbonate": wrong}
    return dataclasses.replace(campaign, spheres=spheres, surfaces=surfaces)


@pytest.fixture(scope="module")
def contradicted(made: tuple[Any, Campaign]) -> FitResult:
    """A sound model of records that contradict one statement; the others are far better known."""
    return fit_campaign(_misstated(made, 1e-4), "kv")


@pytest.fixture(scope="module")
def resting(made: tuple[Any, Campaign]) -> FitResult:
    """The same with spheres that are known no better than usual: moduli lean on the culprit."""
    return fit_campaign(_misstated(made, 2e-2), "kv", heldout=False)


def test_a_modulus_that_does_not_rest_on_the_culprit_is_stated(
    contradicted: FitResult, made: tuple[Any, Campaign]
) -> None:
    """What stays when the culprit is left out is stated, with an interval about the truth."""
    assert contradicted.explained_by_a_statement
    specimen = _withheld(contradicted)
    assert specimen["status"] == "fitted"
    assert specimen["without_conflicts"]["stable"]
    low, high = specimen["youngs_modulus_Pa"]["interval95"]
    assert low <= made[0].moduli["specimen"][0] <= high


def test_where_nobody_asked_on_what_a_modulus_rests_it_is_withheld(contradicted: FitResult) -> None:
    """Without the time for a fit without the culprit nothing is stated beside a contradiction."""
    cut_short = dataclasses.replace(contradicted, statements_asked=False)
    specimen = cut_short.moduli()["specimen"]
    assert specimen["status"] == "withheld"
    assert "surfaces.polycarbonate.youngs_modulus_Pa" in specimen["reason"]
    assert not cut_short.explained_by_a_statement


def test_the_sentence_says_who_it_is_and_what_stays(contradicted: FitResult) -> None:
    """The culprit, what the shots say of it, that noise is left without it, and what stays."""
    said = " ".join(_provisos(contradicted))
    assert "of polycarbonate is" in said
    assert "u from what the shots and all other statements say" in said
    assert "Without it the model leaves only noise." in said
    assert "specimen hardly moves without it" in said


def test_a_modulus_that_rests_on_the_culprit_is_withheld(
    resting: FitResult, made: tuple[Any, Campaign]
) -> None:
    """With the culprit it would be wrong by many u: it is withheld, and says on what it rests."""
    specimen = resting.moduli()["specimen"]
    assert specimen["status"] == "withheld"
    assert "surfaces.polycarbonate.youngs_modulus_Pa" in specimen["reason"]
    assert not specimen["without_conflicts"]["stable"]
    low, high = specimen["without_conflicts"]["youngs_modulus_Pa"]["interval95"]
    assert low <= made[0].moduli["specimen"][0] <= high
    assert "specimen rests on it" in resting.to_json()["sentence"]
    assert _withheld(resting)["status"] == "withheld"


def test_where_more_than_the_statement_is_wrong_moduli_are_withheld(
    made: tuple[Any, Campaign],
) -> None:
    """Structure that stays without the culprit may move any modulus, stable or not."""
    wrong = _misstated(made, 1e-4)
    shots = tuple(
        dataclasses.replace(s, signal=s.signal + 0.05 * np.roll(s.signal, 12)) for s in wrong.shots
    )
    found = fit_campaign(dataclasses.replace(wrong, shots=shots), "kv", heldout=False)
    assert not found.explained_by_a_statement
    assert _withheld(found)["status"] == "withheld"
