"""Restitution from the bounce on records with ring, hum, colour and spikes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from analysis import bounce_indices, restitution_from_bounce
from analysis.bounce import first_impact, restitution_from_rebound_height
from analysis.campaign import Quantity
from analysis.errors import ParameterOutOfRangeError

RATE_HZ = 1e6
TRIGGER = 20_000
G = 9.80665
Array = np.ndarray


@pytest.fixture(scope="module")
def bouncing(truth: Any, impact: Any) -> Any:
    """Return a maker of long records: (volts, true ratio, landing times in samples, speed)."""
    rig = truth(seed=21)

    def make(
        height_m: float, restitution: float, samples: int = 400_000, noise_v: float = 1.5e-3
    ) -> tuple[Array, float, list[float], float]:
        rig.noise_v = noise_v
        volts = rig.noise(samples)
        at, first = float(TRIGGER) + 0.37, math.sqrt(2 * G * height_m)
        speed, ratio, landed = first, math.nan, []
        while at < samples and speed > 0.05 * first:
            begin = int(at) - 4
            times = (begin - at + np.arange(min(4000, samples - begin))) / RATE_HZ
            _, crystal, contact, rebound = impact(
                rig.stiffness("acetal", "polycarbonate"),
                rig.spheres["acetal"][1],
                speed,
                restitution,
                rtol=1e-7,
                **rig.cell,
            ).solve(times)
            volts[begin : begin + times.size] += crystal / 1.2e-8
            landed.append(at)
            ratio = rebound / speed if len(landed) == 1 else ratio
            at += (contact + 2 * rebound / G) * RATE_HZ
            speed = rebound
        return volts, ratio, landed, first

    return make


def _measure(volts: Array, speed: float, **changed: float) -> Any:
    return restitution_from_bounce(
        volts,
        RATE_HZ,
        TRIGGER + 8,
        **{"impact_speed_m_per_s": speed, "gravity_m_per_s2": G} | changed,
    )


@pytest.mark.parametrize("restitution", [0.35, 0.6, 0.9])
@pytest.mark.parametrize("height_m", [0.012, 0.1])
def test_ratio_lies_within_its_uncertainty(
    bouncing: Any, height_m: float, restitution: float
) -> None:
    """The rebound ratio is found within its own uncertainty, which is below a half per cent."""
    volts, ratio, _, speed = bouncing(height_m, restitution)
    found = _measure(volts, speed)
    assert found is not None
    assert abs(found.value - ratio) < 2 * found.u
    assert found.u < 0.005 * ratio


@pytest.mark.parametrize(
    "disturbance", ["hum", "slow ring", "drift", "spikes", "inverted", "steps"]
)
def test_disturbances_are_no_landings(bouncing: Any, disturbance: str) -> None:
    """Hum, a slow ring, drift, single-sample spikes, polarity and rounding change nothing."""
    volts, ratio, landed, speed = bouncing(0.047, 0.75)
    t = (np.arange(volts.size) - TRIGGER) / RATE_HZ
    if disturbance == "hum":
        volts = volts + 0.3 * np.sin(2 * np.pi * 50 * t) + 0.1 * np.sin(2 * np.pi * 150 * t + 1)
    elif disturbance == "slow ring":
        volts = volts + np.where(t > 0, 0.3 * np.exp(-t / 5e-3) * np.sin(9e3 * t), 0.0)
    elif disturbance == "drift":
        volts = volts + 2.0 * t
    elif disturbance == "spikes":
        volts[TRIGGER + 9_000 :: 31_013] += 1.5
    elif disturbance == "inverted":
        volts = -volts
    else:
        volts = np.round(volts / 4.9e-3) * 4.9e-3
    found = _measure(volts, speed)
    assert found is not None
    assert found.value == pytest.approx(ratio, abs=3 * found.u)
    assert len(bounce_indices(volts, RATE_HZ, TRIGGER)) <= len(landed)
    assert first_impact(volts, RATE_HZ, TRIGGER) == TRIGGER


@pytest.mark.parametrize("early_s", [6e-3, 19e-3])
@pytest.mark.parametrize("polarity", [1.0, -1.0])
def test_what_set_off_the_trigger_early_is_not_the_impact(
    bouncing: Any, early_s: float, polarity: float
) -> None:
    """The baseline wanders through the trigger level, and the sphere lands later."""
    volts, _, landed, _ = bouncing(0.047, 0.75)
    way = 8e-4 * np.cumsum(np.random.default_rng(2).standard_normal(volts.size))
    early = TRIGGER - round(early_s * RATE_HZ)
    found = first_impact(polarity * volts + way, RATE_HZ, early)
    assert found == pytest.approx(landed[0], abs=40)


def test_a_limited_first_impact_is_the_first_all_the_same(bouncing: Any) -> None:
    """A slow amplifier or a ceiling lets a gentler bounce seem as hard."""
    volts, *_ = bouncing(0.047, 0.75)
    cut = np.clip(volts, -0.3, 0.3)
    cut[TRIGGER - 10 : TRIGGER + 4000] *= 0.7
    assert first_impact(cut, RATE_HZ, TRIGGER) == TRIGGER


def test_what_is_louder_than_an_impact_later_is_none(bouncing: Any) -> None:
    """The valve's coil puts five times the pulse on the line when it closes behind the sphere."""
    volts, *_ = bouncing(0.047, 0.75)
    since = np.arange(300)
    coil = 5.0 * volts.max() * np.exp(-since / 60.0) * np.cos(0.3 * since)
    volts[TRIGGER + 15_000 : TRIGGER + 15_300] += coil
    assert first_impact(volts, RATE_HZ, TRIGGER + 8) == TRIGGER + 8


def test_noise_is_no_impact_that_comes_later(bouncing: Any) -> None:
    """A sphere that fell beside the coupon: the trigger stays where it is."""
    noise = 1.5e-3 * np.random.default_rng(4).standard_normal(400_000)
    assert first_impact(noise, RATE_HZ, TRIGGER) == TRIGGER
    assert first_impact(np.zeros(400_000), RATE_HZ, TRIGGER) == TRIGGER
    assert first_impact(noise[:TRIGGER], RATE_HZ, TRIGGER) == TRIGGER


def test_all_landings_are_listed_as_triggers(bouncing: Any) -> None:
    """Every landing of a low drop is listed at its onset, the first one included."""
    volts, _, landed, _ = bouncing(0.012, 0.7)
    found = bounce_indices(volts, RATE_HZ, TRIGGER)
    assert len(found) >= 5
    np.testing.assert_allclose(found, landed[: len(found)], atol=25)


def test_uncertainty_of_the_impact_speed_is_carried(bouncing: Any) -> None:
    """A speed known to one per cent makes a ratio known to one per cent."""
    volts, _, _, speed = bouncing(0.047, 0.8)
    found = _measure(volts, speed, impact_speed_u_m_per_s=0.01 * speed)
    assert found is not None
    assert found.u / found.value == pytest.approx(0.01, rel=0.01)


def test_nothing_is_said_when_the_record_is_too_short(bouncing: Any) -> None:
    """A record that ends before the second landing gives no restitution."""
    volts, _, _, speed = bouncing(0.1, 0.9, samples=120_000)
    assert _measure(volts, speed) is None
    assert len(bounce_indices(volts, RATE_HZ, TRIGGER)) == 1


def test_nothing_is_said_when_nothing_lands(bouncing: Any) -> None:
    """Noise after one impact, a flat record and an empty one give no restitution."""
    volts, _, _, speed = bouncing(0.1, 0.9, samples=120_000)
    quiet = np.concatenate([volts, 1.5e-3 * np.random.default_rng(1).standard_normal(280_000)])
    assert _measure(quiet, speed) is None
    assert _measure(np.zeros(400_000), speed) is None
    assert (
        restitution_from_bounce(
            np.zeros(10), RATE_HZ, 5, impact_speed_m_per_s=1.0, gravity_m_per_s2=G
        )
        is None
    )


def test_a_landing_faster_than_the_impact_is_none(bouncing: Any) -> None:
    """A flight that would need more speed than the impact had is not called a rebound."""
    volts, _, _, speed = bouncing(0.047, 0.8)
    assert _measure(volts, 0.5 * speed) is None


def test_a_second_touch_right_after_the_first_is_no_rebound(bouncing: Any) -> None:
    """A hard second pulse a few milliseconds on contradicts so short a flight and is refused."""
    volts, _, _, speed = bouncing(0.047, 0.8)
    pulse = volts[TRIGGER - 10 : TRIGGER + 2000].copy()
    volts[TRIGGER + 5000 - 10 : TRIGGER + 7000] += 0.7 * pulse
    assert _measure(volts, speed) is None


def test_rebound_height_gives_the_ratio_of_speeds() -> None:
    """A quarter of the height is half the speed; 2 % of the height are 1 % of it."""
    found = restitution_from_rebound_height(Quantity(0.01, 0.0002), 0.04)
    assert found.value == pytest.approx(0.5)
    assert found.u == pytest.approx(0.005, rel=0.01)


@pytest.mark.parametrize(
    ("rebound_m", "drop_m"), [(0.0, 0.04), (-0.01, 0.04), (0.05, 0.04), (0.01, 0)]
)
def test_impossible_rebounds_are_refused(rebound_m: float, drop_m: float) -> None:
    """No height, a negative one, or one above the drop is refused by name."""
    with pytest.raises(ParameterOutOfRangeError, match="height_m"):
        restitution_from_rebound_height(Quantity(rebound_m, 1e-4), drop_m)
