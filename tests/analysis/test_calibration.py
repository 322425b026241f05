"""Calibration of the cell from drops of known pairs, its document, and drift between two."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from analysis import AnalysisError, calibrate, drift, fit_campaign, sensor_from_json
from analysis.calibration import CalibrationResult
from analysis.campaign import Campaign, Quantity

KNOWN = (("acetal", "polycarbonate"), ("hdpe", "polycarbonate"))


@pytest.fixture(scope="module")
def calibrated(made: tuple[Any, Campaign]) -> CalibrationResult:
    """Return the KV calibration from the known pairs of the synthetic campaign."""
    return calibrate(made[1], "kv")


def test_cell_is_recovered_within_its_uncertainty(made: Any, calibrated: Any) -> None:
    """Frequency, damping ratio, gain and Table 3's four parameters cover the truth."""
    cell = made[0].cell
    k, mass, mu = cell["crystal_stiffness"], cell["crystal_mass"], cell["crystal_damping"]
    found = calibrated.to_json()
    assert found["outcome"]["status"] == "converged"
    truth = {
        ("identifiable", "gain_N_per_V"): k * 1.2e-8,
        ("identifiable", "natural_frequency_Hz"): math.sqrt(k / mass) / (2 * math.pi),
        ("identifiable", "damping_ratio"): mu / (2 * math.sqrt(k * mass)),
        ("parameters", "crystal_mass_kg"): mass,
        ("parameters", "crystal_stiffness_n_per_m"): k,
        ("parameters", "crystal_damping_n_s_per_m"): mu,
        ("parameters", "compliance_m_per_v"): 1.2e-8,
    }
    for (section, name), value in truth.items():
        entry = found[section][name]
        assert abs(entry["value"] - value) < 3.5 * entry["u"], name
        low, high = entry["interval95"]
        assert low < entry["value"] < high


def test_only_known_pairs_calibrate_and_the_others_are_listed(calibrated: Any) -> None:
    """Shots on the specimen are left out, by name and with the reason."""
    found = calibrated.to_json()
    assert len(found["shots"]) == 6
    assert len(found["excluded"]) == 6
    assert all("specimen" in e["reason"] for e in found["excluded"])


def test_crystal_mass_is_admitted_to_be_the_certificates(calibrated: Any) -> None:
    """The result says in words that drops hardly see the crystal's mass."""
    assert any("mass" in w for w in calibrated.warnings)


def test_document_rebuilds_the_sensor(calibrated: Any) -> None:
    """The JSON, through text, gives back values, covariance and HSD's S."""
    text = json.dumps(calibrated.to_json(), allow_nan=False)
    sensor = sensor_from_json(json.loads(text))
    assert sensor.covariance is not None
    np.testing.assert_array_equal(sensor.covariance, calibrated.sensor.covariance)
    assert np.linalg.eigvalsh(sensor.covariance).min() > 0
    for name, j in (("crystal_mass_kg", 0), ("compliance_m_per_v", 3)):
        quantity = getattr(sensor, name)
        assert quantity.u / quantity.value == pytest.approx(
            math.sqrt(sensor.covariance[j, j]), rel=1e-9
        )
    assert sensor.hsd_n_per_v is not None
    assert sensor.hsd_n_per_v.value > 0


def test_covariance_keeps_what_the_drops_identified(calibrated: Any) -> None:
    """Gain and frequency keep their small uncertainty through the covariance of M, k, mu, c."""
    sensor = calibrated.sensor
    assert sensor.covariance is not None
    gain = np.array([0, 1, 0, 1.0])
    frequency = np.array([-0.5, 0.5, 0, 0])
    found = calibrated.to_json()["identifiable"]
    for direction, name in ((gain, "gain_N_per_V"), (frequency, "natural_frequency_Hz")):
        u = math.sqrt(float(direction @ sensor.covariance @ direction))
        assert u == pytest.approx(found[name]["u"] / found[name]["value"], rel=1e-3)


def test_calibrated_cell_measures_the_specimen(made: Any, calibrated: Any) -> None:
    """Later shots fitted with the calibrated cell alone give the specimen's modulus."""
    rig, campaign = made
    shots = tuple(s for s in campaign.shots if s.surface == "specimen")
    later = dataclasses.replace(campaign, shots=shots, sensor=calibrated.sensor)
    low, high = fit_campaign(later, "kv").moduli()["specimen"]["youngs_modulus_Pa"]["interval95"]
    assert low <= rig.moduli["specimen"][0] <= high


def test_unchanged_cell_is_stable(truth: Any, made: Any, calibrated: Any) -> None:
    """A second run on the same cell shows no drift, though it started from the first's values."""
    again = truth(seed=77).campaign(pairs=KNOWN, unknown=())
    again = dataclasses.replace(
        again,
        sensor=calibrated.sensor,
        spheres=made[1].spheres,
        surfaces=made[1].surfaces,
    )
    second = calibrate(again, "kv")
    assert any("earlier calibration" in w for w in second.warnings)
    found = drift(calibrated, second)
    assert found["largest_in_u"] < 3.5
    assert set(found["combinations"]) == {"gain_N_per_V", "natural_frequency_Hz", "damping_ratio"}


def test_changed_cell_is_seen_to_drift(truth: Any, made: Any, calibrated: Any) -> None:
    """A cell whose stiffness fell by 4 % drifts in frequency, and the sentence says so."""
    rig = truth(seed=78)
    rig.cell["crystal_stiffness"] *= 0.96
    later = dataclasses.replace(
        rig.campaign(pairs=KNOWN, unknown=()),
        sensor=calibrated.sensor,
        spheres=made[1].spheres,
        surfaces=made[1].surfaces,
    )
    found = drift(calibrated.to_json(), calibrate(later, "kv").to_json())
    change = found["combinations"]["natural_frequency_Hz"]
    assert change["change"] == pytest.approx(math.sqrt(0.96) - 1, abs=1e-3)
    assert change["in_u"] < -5
    assert "drifted" in found["sentence"]


def test_short_stiff_contacts_are_called_not_identifiable(truth: Any) -> None:
    """Steel on steel barely shows its contact law, and the calibration says which pair that is."""
    rig = truth(seed=5)
    rig.moduli |= {"steel": (194e9, 0.33), "plate": (200e9, 0.29)}
    rig.spheres["steel"] = (2.99e-3, 0.878e-3)
    campaign = rig.campaign(pairs=(("steel", "plate"),), heights_m=(0.02, 0.05), unknown=())
    found = calibrate(campaign, "kv")
    assert any("steel/plate" in w and "not identifiable" in w for w in found.warnings)
    assert any("only one pair" in w for w in found.warnings)


def test_nothing_known_cannot_calibrate(made: Any) -> None:
    """Without a pair of stated moduli the calibration refuses and says what to drop."""
    shots = tuple(s for s in made[1].shots if s.surface == "specimen")
    with pytest.raises(AnalysisError, match="no stated modulus"):
        calibrate(dataclasses.replace(made[1], shots=shots), "kv")


def test_hsd_calibration_gives_its_gain_alone(made: Any) -> None:
    """Calibrating the rigid-cell model gives S and a sensor without crystal."""
    found = calibrate(made[1], "hsd")
    assert found.to_json()["parameters"] == {}
    assert found.sensor.covariance is None
    assert isinstance(found.sensor.hsd_n_per_v, Quantity)


def test_foreign_documents_are_refused(calibrated: Any) -> None:
    """What is no calibration, or one that did not converge, builds no sensor."""
    with pytest.raises(AnalysisError, match="no calibration"):
        sensor_from_json({"format": "impactd-fit/1"})
    failed = calibrated.to_json() | {
        "outcome": {"status": "not_converged", "message": "The fit still moved."}
    }
    with pytest.raises(AnalysisError, match="still moved"):
        sensor_from_json(failed)
