"""Who contradicts whom: a wrong statement is named; moduli that do not rest on it are stated."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign, Quantity, Uncertainty
from analysis.fit.conflicts import conflicts


def _misstated(campaign: Campaign, factor: float) -> Campaign:
    """Return a campaign whose polycarbonate is stated wrong by a factor."""
    coupon = campaign.surfaces["polycarbonate"]
    said = coupon.youngs_modulus_pa
    assert said is not None
    wrong = dataclasses.replace(
        coupon, youngs_modulus_pa=Quantity(said.value * factor, said.u * factor)
    )
    return dataclasses.replace(campaign, surfaces=campaign.surfaces | {"polycarbonate": wrong})


def _bound(campaign: Campaign) -> Campaign:
    """Return a campaign whose spheres are well known, so that the shots can contradict others."""
    spheres = {
        n: dataclasses.replace(
            s,
            youngs_modulus_pa=Quantity(s.youngs_modulus_pa.value, 5e-3 * s.youngs_modulus_pa.value),
        )
        for n, s in campaign.spheres.items()
        if s.youngs_modulus_pa is not None
    }
    return dataclasses.replace(campaign, spheres=spheres)


def test_sound_statements_conflict_with_nothing(made: tuple[Any, Campaign]) -> None:
    """References within their uncertainty are no conflict, and no modulus speaks of one."""
    result = fit_campaign(made[1], "kv", heldout=False)
    assert result.conflicts == []
    assert result.without_conflicts is None
    assert result.to_json()["conflicts"] == []
    assert "without_conflicts" not in result.moduli()["specimen"]


def test_the_misstated_reference_is_named(shared_campaign: Any) -> None:
    """A polycarbonate stated at 2.9 GPa is named with what the shots say; the specimen stays."""
    campaign, truth = shared_campaign("campaigns/clean")
    result = fit_campaign(_misstated(campaign, 2.9 / 2.2), "kv", heldout=False)
    (conflict,) = result.conflicts
    assert conflict.path == "surfaces.polycarbonate.youngs_modulus_Pa"
    assert abs(conflict.score) > 8
    assert "2.9 GPa of polycarbonate" in conflict.sentence
    assert "2.2 GPa" in conflict.sentence
    specimen = result.moduli()["specimen"]
    assert specimen["without_conflicts"]["stable"]
    low, high = specimen["youngs_modulus_Pa"]["interval95"]
    assert low <= truth["specimen_youngs_modulus_Pa"] <= high


def test_a_wrong_modulus_among_good_ones_is_named_alone(made: tuple[Any, Campaign]) -> None:
    """Only the culprit is in conflict, with what all others say, and JSON says so."""
    rig, campaign = made
    result = fit_campaign(_misstated(_bound(campaign), 1.4), "kv", heldout=False)
    worst = result.conflicts[0]
    assert worst.name == "surface.polycarbonate"
    assert worst.found.value == pytest.approx(rig.moduli["polycarbonate"][0], rel=0.15)
    document = result.to_json()
    json.dumps(document, allow_nan=False)
    assert document["conflicts"][0]["sentence"] == worst.sentence
    assert worst.sentence in document["sentence"]
    assert "Of the moduli that were to be found, specimen" in document["sentence"]
    assert "references_contradicted" in document["flags"]
    without = document["moduli"]["polycarbonate"]["without_conflicts"]
    assert without["plane_strain_modulus_Pa"]["value"] > 0


def test_what_no_float_holds_is_no_conflict(made: tuple[Any, Campaign]) -> None:
    """A model that lacks much may ask, to first order, for a modulus of e^1000 Pa."""
    result = fit_campaign(_bound(made[1]), "kv", heldout=False)
    theta = result.fitted.theta.copy()
    theta[result.problem.names.index("surface.polycarbonate")] += 1e3
    assert conflicts(result.problem, dataclasses.replace(result.fitted, theta=theta)) == []


def test_a_wrong_height_offset_is_a_conflict_too(made: tuple[Any, Campaign]) -> None:
    """Heights that are all 3 mm off by a tenth of a millimetre's word contradict the shots."""
    campaign = made[1]
    shots = tuple(
        dataclasses.replace(s, drop_height_m=(s.drop_height_m or 0.0) + 3e-3)
        for s in campaign.shots
    )
    wrong = dataclasses.replace(campaign, shots=shots, u_height_offset_m=Uncertainty(1e-4))
    result = fit_campaign(wrong, "kv", heldout=False)
    worst = result.conflicts[0]
    assert worst.path == "release.height_offset_u_m"
    assert worst.found.value == pytest.approx(-3e-3, abs=5e-4)


def test_a_model_that_misses_something_does_not_send_people_to_check_everything(
    made: tuple[Any, Campaign],
) -> None:
    """HSD has no cell that rings: what it contradicts is listed, the worst alone in a sentence."""
    result = fit_campaign(_bound(made[1]), "hsd", heldout=False)
    assert len(result.conflicts) > 1
    assert not result.explained_by_a_statement
    said = result.contradictions()
    assert said[0] == result.conflicts[0].sentence
    assert all(one.path in said[1] for one in result.conflicts[1:])
    assert "misses something else" in said[2]
    assert not any(one.sentence in " ".join(said) for one in result.conflicts[1:])
