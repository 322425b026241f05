"""Numbers of a campaign folder as quantities with an uncertainty."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from analysis.campaign import Environment, Quantity, Uncertainty
from impactd.storage.campaign_folder import read_campaign, read_campaign_folder, write_campaign
from impactd.storage.errors import CampaignError

Make = Callable[..., Path]
Root = dict[str, Any]


def _measured(root: Root, _: Path) -> None:
    root["gravity_m_per_s2"] = {"value": 9.81, "u": 1e-4}
    root["release"] |= {"height_offset_u_m": 3e-4, "distribution": "rectangular"}
    root["sample_rate_u_relative"] = 25e-6
    root["environment"] = {"temperature_C": {"value": 22.5, "u": 0.3}}
    root["spheres"]["acetal"] |= {
        "radius_m": {"value": 4.76e-3, "u": 7.3e-6, "distribution": "rectangular"},
        "mass_kg": {"value": 6.1e-4, "u": 3e-7, "degrees_of_freedom": 9, "traceable_to": "OIML E2"},
        "modulus_coefficient_per_K": {"value": -5e-3, "u": 1e-3},
        "modulus_temperature_C": 20.0,
    }
    root["sensor"] |= {
        "log_covariance": [[1e-4 * (i == j) for j in range(4)] for i in range(4)],
        "calibration_inputs": {"input.mass.acetal": [0.0, 1e-3, 2e-3, -1e-3]},
        "hsd_calibration_inputs": {"input.mass.acetal": 3e-3},
    }
    root["surfaces"]["specimen"] |= {
        "coupon_mass_kg": {"value": 3.6e-3, "u": 1e-6},
        "coupon_thickness_m": {"value": 2e-3, "u": 1e-5},
    }
    root["shots"][0] |= {
        "drop_height_m": {"value": 0.047, "u": 1e-4},
        "sample_rate_Hz": {"value": 1e6, "u": 25.0},
        "volts_per_code": {"value": 0.00030517578125, "u": 3.0517578125e-8},
        "environment": {"relative_humidity": {"value": 0.45, "u": 0.03}},
    }


def test_every_number_may_have_an_uncertainty(campaign_folder: Make) -> None:
    """Values arrive as before, and beside them what is said of their uncertainty."""
    campaign = read_campaign(campaign_folder(_measured))
    ball, coupon = campaign.spheres["acetal"], campaign.surfaces["specimen"]
    shot, plain = campaign.shots[0], campaign.shots[1]

    assert (ball.radius_m, ball.u_radius_m) == (4.76e-3, Uncertainty(7.3e-6, "rectangular"))
    assert ball.u_mass_kg == Uncertainty(3e-7, "normal", 9.0, "OIML E2")
    assert ball.modulus_coefficient_per_k == Quantity(-5e-3, 1e-3)
    assert (ball.modulus_temperature_c, coupon.modulus_temperature_c) == (20.0, 23.0)
    assert campaign.sensor.inputs == {"input.mass.acetal": (0.0, 1e-3, 2e-3, -1e-3)}
    assert campaign.sensor.hsd_inputs == {"input.mass.acetal": 3e-3}
    assert (coupon.coupon_mass_kg, coupon.u_coupon_mass_kg) == (3.6e-3, Uncertainty(1e-6))
    assert coupon.u_coupon_thickness_m == Uncertainty(1e-5)
    assert (campaign.gravity_m_per_s2, campaign.u_gravity_m_per_s2) == (9.81, Uncertainty(1e-4))
    assert campaign.u_height_offset_m == Uncertainty(3e-4, "rectangular")
    assert campaign.u_sample_rate_relative == Uncertainty(25e-6)
    assert campaign.environment == Environment(temperature_c=Quantity(22.5, 0.3))
    assert (shot.drop_height_m, shot.u_drop_height_m) == (0.047, Uncertainty(1e-4))
    assert (shot.sample_rate_hz, shot.u_sample_rate_hz) == (1e6, Uncertainty(25.0))
    assert shot.u_gain_relative == pytest.approx(1e-4)
    assert shot.environment == Environment(relative_humidity=Quantity(0.45, 0.03))
    assert (plain.u_drop_height_m, plain.u_sample_rate_hz, plain.u_gain_relative) == (None, None, 0)


def test_uncertainties_survive_a_round_trip(campaign_folder: Make, tmp_path: Path) -> None:
    """What is written reads back with all that was said of its uncertainty."""
    first = read_campaign_folder(campaign_folder(_measured))
    recordings = tuple(one.recording for one in first.shots)

    second = read_campaign(write_campaign(tmp_path / "copy", first.campaign, recordings))

    for name in (
        "spheres",
        "surfaces",
        "u_gravity_m_per_s2",
        "u_height_offset_m",
        "u_sample_rate_relative",
        "environment",
    ):
        assert getattr(second, name) == getattr(first.campaign, name)
    assert second.sensor.inputs == first.campaign.sensor.inputs
    assert second.sensor.hsd_inputs == first.campaign.sensor.hsd_inputs
    for before, after in zip(first.campaign.shots, second.shots, strict=True):
        assert after.u_drop_height_m == before.u_drop_height_m
        assert after.u_sample_rate_hz == before.u_sample_rate_hz
        assert after.u_gain_relative == pytest.approx(before.u_gain_relative)
        assert after.environment == before.environment


@pytest.mark.parametrize(
    "values", [[1e-3, 1e-3, 1e-3], [1e-3, 1e-3, 1e-3, "x"], [1e-3, 1e-3, 1e-3, 1e9], [True] * 4]
)
def test_a_bad_change_of_a_calibration_is_refused(
    campaign_folder: Make, values: list[object]
) -> None:
    """How a calibration follows an input is four numbers, of logarithms."""

    def change(root: Root, folder: Path) -> None:
        _measured(root, folder)
        root["sensor"]["calibration_inputs"] = {"input.mass.acetal": values}

    with pytest.raises(CampaignError) as raised:
        read_campaign(campaign_folder(change))
    assert raised.value.json_path == "$.sensor.calibration_inputs.input.mass.acetal"
    assert "four numbers" in raised.value.reason


@pytest.mark.parametrize(
    ("number", "path", "reason"),
    [
        ({"value": 6e-4}, "$.spheres.acetal.mass_kg.u", "uncertainty"),
        ({"u": 1e-7}, "$.spheres.acetal.mass_kg.value", "missing"),
        ({"value": -6e-4, "u": 1e-7}, "$.spheres.acetal.mass_kg.value", "between 1e-15"),
        ({"value": 6e-4, "u": -1e-7}, "$.spheres.acetal.mass_kg.u", "between 0"),
        ({"value": 6e-4, "u": 7e-4}, "$.spheres.acetal.mass_kg.u", "between 0 and 0.0006 kg"),
        ({"value": 6e-4, "u": 1e-300}, "$.spheres.acetal.mass_kg.u", "at least 6e-16 kg"),
        ({"value": 1e300, "u": 1e290}, "$.spheres.acetal.mass_kg.value", "between 1e-15"),
        (
            {"value": 6e-4, "u": 1e-7, "distribution": "triangle"},
            "$.spheres.acetal.mass_kg.distribution",
            "rectangular",
        ),
        (
            {"value": 6e-4, "u": 1e-7, "degrees_of_freedom": 0},
            "$.spheres.acetal.mass_kg.degrees_of_freedom",
            "between 1",
        ),
    ],
)
def test_a_bad_quantity_is_refused_with_path_and_reason(
    campaign_folder: Make, number: object, path: str, reason: str
) -> None:
    """A quantity without value or uncertainty, or of an impossible one, is refused."""

    def change(root: Root, _: Path) -> None:
        root["spheres"]["acetal"]["mass_kg"] = number

    with pytest.raises(CampaignError) as caught:
        read_campaign(campaign_folder(change))

    assert caught.value.json_path == path
    assert reason in caught.value.reason
