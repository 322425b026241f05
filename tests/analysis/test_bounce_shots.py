"""Later bounces of one record as shots of their own."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest

from analysis import bounce_shots, calibrate, fit_campaign, with_bounces
from analysis.campaign import Campaign, Quantity, Shot

RATE_HZ = 1e6
TRIGGER = 20_000
G = 9.80665


@pytest.fixture(scope="module")
def long_record(truth: Any, impact: Any) -> Any:
    """Return a maker of bouncing records: (shot, speeds at the landings, rig)."""
    rig = truth(seed=51)

    def make(
        height_m: float, e: float, sphere: str = "acetal", surface: str = "polycarbonate"
    ) -> tuple[Shot, list[float]]:
        volts = rig.noise(400_000) + 0.01
        at, speed, speeds = TRIGGER + 0.37, math.sqrt(2 * G * height_m), []
        while at < volts.size and len(speeds) < 9:
            begin = int(at) - 4
            times = (begin - at + np.arange(min(4000, volts.size - begin))) / RATE_HZ
            _, crystal, contact, rebound = impact(
                rig.stiffness(sphere, surface),
                rig.spheres[sphere][1],
                speed,
                e,
                rtol=1e-8,
                **rig.cell,
            ).solve(times)
            volts[begin : begin + times.size] += crystal / 1.2e-8
            speeds.append(speed)
            at += (contact + 2 * rebound / G) * RATE_HZ
            speed = rebound
        shot = Shot(
            name=f"{sphere} on {surface}",
            signal=volts,
            sample_rate_hz=RATE_HZ,
            trigger_index=TRIGGER + 8,
            sphere=sphere,
            surface=surface,
            drop_height_m=height_m,
        )
        return shot, speeds

    make.rig = rig  # type: ignore[attr-defined]
    return make


def _campaign(rig: Any, shots: tuple[Shot, ...], unknown: tuple[str, ...]) -> Campaign:
    about = rig.campaign(pairs=(), unknown=unknown)
    return dataclasses.replace(about, shots=shots)


@pytest.mark.parametrize(("height_m", "e"), [(0.02, 0.75), (0.05, 0.6), (0.01, 0.85)])
def test_speeds_lie_within_their_uncertainty(long_record: Any, height_m: float, e: float) -> None:
    """Every bounce's speed is that of the made flight, known to a thousandth."""
    shot, speeds = long_record(height_m, e)
    found = bounce_shots(shot, G)
    assert len(found) >= 2
    for one, speed in zip(found, speeds[1:], strict=False):
        measured = one.impact_speed_m_per_s
        assert measured is not None
        assert abs(measured.value - speed) < 2.5 * measured.u
        assert measured.u < 0.003 * speed
        assert one.drop_height_m is None


def test_restitution_comes_from_the_next_flight(long_record: Any) -> None:
    """A bounce followed by another one knows its own restitution, the last one does not."""
    shot, speeds = long_record(0.02, 0.75)
    found = bounce_shots(shot, G)
    first = found[0].restitution
    assert first is not None
    assert abs(first.value - speeds[2] / speeds[1]) < 3 * first.u


def test_bounces_sharpen_the_modulus_and_agree(long_record: Any) -> None:
    """The same two records with their bounces: more shots, a smaller u, the same specimen."""
    rig = long_record.rig
    shots = tuple(long_record(h, 0.7, "acetal", "specimen")[0] for h in (0.015, 0.04))
    campaign = _campaign(rig, shots, ("specimen",))
    without = fit_campaign(campaign, "kv", by_pair=True, heldout=False)
    found = fit_campaign(with_bounces(campaign), "kv", by_pair=True, heldout=False)
    assert len(found.shots) >= 6
    assert found.outcome.status == "converged"
    assert found.chi2_per_dof == pytest.approx(1.0, abs=0.03)
    radius = rig.spheres["acetal"][0]
    true = math.log(rig.stiffness("acetal", "specimen") / (4 / 3 * math.sqrt(radius)))
    u = []
    for fit in (without, found):
        modulus = fit.pair_modulus(fit.shots[0].item)
        assert modulus is not None
        assert abs(modulus[0] - true) < 3 * modulus[1]
        u.append(modulus[1])
    assert u[1] < 0.8 * u[0]


def test_bounces_calibrate(long_record: Any) -> None:
    """A calibration counts bounces as shots of their own speed and lists them by name."""
    shots = tuple(long_record(h, 0.7)[0] for h in (0.02, 0.04))
    campaign = _campaign(long_record.rig, shots, ())
    found = calibrate(with_bounces(campaign), "kv").to_json()
    assert found["outcome"]["status"] == "converged"
    assert "acetal on polycarbonate, bounce 1" in found["shots"]
    gain = found["identifiable"]["gain_N_per_V"]
    assert abs(gain["value"] - 4.16e8 * 1.2e-8) < 3.5 * gain["u"]


def test_a_wrong_restitution_is_flagged(long_record: Any) -> None:
    """A rebound that the trace contradicts is called so; the true one is not."""
    shot, speeds = long_record(0.04, 0.7)
    ratio = speeds[1] / speeds[0]
    for stated, flagged in ((ratio, False), (ratio + 0.12, True)):
        told = dataclasses.replace(shot, restitution=Quantity(stated, 0.005))
        fit = fit_campaign(
            _campaign(long_record.rig, (told,), ()), "kv", by_pair=True, heldout=False
        )
        assert ("restitution_disagrees" in fit.shots[0].flags()) is flagged
        check = fit.to_json()["shots"][0]["restitution_check"]
        assert check["stated"] == {"value": stated, "u": 0.005}


def test_nothing_comes_from_what_holds_no_bounce(made: tuple[Any, Campaign]) -> None:
    """Short records, clipped ones and those of unknown materials give no bounces."""
    assert with_bounces(made[1]).shots == made[1].shots


def test_a_wild_landing_ends_the_chain(long_record: Any) -> None:
    """A blow that the flight before does not explain is no bounce, nor is what follows it."""
    shot, _ = long_record(0.02, 0.75)
    volts = shot.signal.copy()
    pulse = volts[TRIGGER - 10 : TRIGGER + 2000] - 0.01
    second = bounce_shots(shot, G)
    assert len(second) == 3
    knocked = TRIGGER + 105_000
    volts[knocked : knocked + pulse.size] += 2 * pulse
    assert len(bounce_shots(dataclasses.replace(shot, signal=volts), G)) < 3
    assert bounce_shots(dataclasses.replace(shot, clipped=True), G) == ()
    assert bounce_shots(dataclasses.replace(shot, sphere=None), G) == ()
