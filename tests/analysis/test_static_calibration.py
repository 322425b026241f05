"""Gain from weights: the line, its uncertainty, and what the discharge does to it."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from analysis.errors import AnalysisError, ParameterOutOfRangeError
from analysis.static_calibration import Reading, StaticCalibration, compare, static_calibration

G = 9.80665
GAIN = 1780.0
MASSES = (0.0, 0.1, 0.2, 0.5, 1.0)


def _readings(
    *, gain: float = GAIN, u: float | None = 2e-6, noise: float = 0.0, left: float = 1.0
) -> list[Reading]:
    rng = np.random.default_rng(3)
    return [
        Reading(m, 0.02 + left * m * G / gain + noise * rng.standard_normal(), u) for m in MASSES
    ]


def _found(readings: list[Reading], **changed: Any) -> StaticCalibration:
    told = {"hold_time_s": 1.0, "discharge_time_constant_s": 1e6, "gravity_m_per_s2": G}
    return static_calibration(readings, **{**told, **changed})


def test_gain_and_offset_are_those_of_the_line() -> None:
    """Exact readings give the gain and the empty cell's reading back."""
    found = _found(_readings())
    assert found.gain_n_per_v == pytest.approx(GAIN, rel=1e-9)
    assert found.offset_v == pytest.approx(0.02, rel=1e-9)
    assert found.status == "usable"
    assert found.warnings == ()


def test_uncertainty_is_that_of_weighted_least_squares() -> None:
    """The slope's uncertainty is numpy's for the same weights."""
    readings = _readings(noise=1.5e-6)
    found = _found(readings)
    force, volts = np.array(MASSES) * G, np.array([r.volts for r in readings])
    line, covariance = np.polyfit(force, volts, 1, w=np.full(5, 1 / 2e-6), cov="unscaled")
    assert found.gain_n_per_v == pytest.approx(1 / line[0])
    assert found.u_gain_n_per_v / found.gain_n_per_v == pytest.approx(
        math.sqrt(covariance[0, 0]) / line[0]
    )


def test_unstated_uncertainties_come_from_the_scatter() -> None:
    """Without u_volts the residuals say how well the line is known, and chi2 says nothing."""
    readings = _readings(noise=1e-5, u=None)
    found = _found(readings)
    volts = np.array([r.volts for r in readings])
    line, covariance = np.polyfit(np.array(MASSES) * G, volts, 1, cov=True)
    assert found.u_gain_n_per_v / found.gain_n_per_v == pytest.approx(
        math.sqrt(covariance[0, 0]) / line[0]
    )
    assert found.chi2_per_dof is None


def test_excess_scatter_widens() -> None:
    """Readings that scatter ten times more than stated widen the uncertainty and are named."""
    found = _found(_readings(noise=2e-5))
    assert found.chi2_per_dof is not None
    assert found.chi2_per_dof > 9
    assert any("scatter" in w for w in found.warnings)


def test_intervals_cover() -> None:
    """Of 400 made calibrations, 95 % have the true gain within two uncertainties."""
    rng = np.random.default_rng(1)
    inside = 0
    for _ in range(400):
        readings = [Reading(m, m * G / GAIN + 2e-6 * rng.standard_normal(), 2e-6) for m in MASSES]
        found = _found(readings)
        inside += abs(found.gain_n_per_v - GAIN) < 1.96 * found.u_gain_n_per_v
    assert 367 <= inside <= 393


@pytest.mark.parametrize(("hold_s", "tau_s"), [(5.0, 0.5), (2.0, 2.0), (1.0, 1e-3)])
def test_a_discharged_reading_is_meaningless(hold_s: float, tau_s: float) -> None:
    """Where less than half is left no gain is given, and the words say how much is left."""
    found = _found(_readings(left=0.4, u=1e-6), hold_time_s=hold_s, discharge_time_constant_s=tau_s)
    document = found.to_json()
    assert document["outcome"]["status"] == "meaningless"
    assert document["hsd"] is None
    assert document["discharge"]["share_left"] == pytest.approx(math.exp(-hold_s / tau_s))
    assert "Meaningless" in document["warnings"][0]
    json.dumps(document, allow_nan=False)


def test_a_slow_discharge_is_a_stated_bias() -> None:
    """One second at 100 s makes S a per cent too large: usable, said with its size, not hidden."""
    left = math.exp(-0.01)
    found = _found(_readings(left=left), discharge_time_constant_s=100.0)
    assert found.status == "usable"
    assert found.gain_n_per_v == pytest.approx(GAIN / left, rel=1e-9)
    assert found.to_json()["discharge"]["relative_error_of_gain"] == pytest.approx(1 / left - 1)
    assert "1.0" in found.warnings[0]


def test_an_unknown_discharge_time_is_unproven() -> None:
    """Nobody stated the time constant: the gain is given, with what that leaves open."""
    found = _found(_readings(), discharge_time_constant_s=None)
    assert found.status == "unproven"
    assert "not stated" in found.warnings[0]


def test_inverted_polarity_is_named() -> None:
    """A falling reading gives a positive gain and a word."""
    found = _found([Reading(r.mass_kg, -r.volts, r.u_volts) for r in _readings()])
    assert found.gain_n_per_v == pytest.approx(GAIN)
    assert any("polarity" in w for w in found.warnings)


def test_what_fixes_no_slope_is_refused() -> None:
    """One mass, two readings without uncertainty, flat readings: each is refused with its cure."""
    one, two = Reading(0.1, 1.0, 1e-3), Reading(0.2, 2.0, 1e-3)
    for bad in ([one, one], [Reading(0.1, 1.0), Reading(0.2, 2.0)], [one, Reading(0.2, 2.0)]):
        with pytest.raises(AnalysisError):
            _found(bad)
    flat = [Reading(m, 0.02, 1e-3) for m in MASSES]
    with pytest.raises(AnalysisError, match="discharged"):
        _found(flat)
    for changed in ({"hold_time_s": -1.0}, {"discharge_time_constant_s": 0.0}):
        with pytest.raises(ParameterOutOfRangeError):
            _found([one, two], **changed)
    with pytest.raises(ParameterOutOfRangeError):
        _found([one, Reading(-0.2, 2.0, 1e-3)])


def test_weights_are_compared_with_drops() -> None:
    """S from weights is held against k c and against the rigid cell's S, in combined u."""
    static = _found(_readings()).to_json()
    dynamic = {
        "model": "kv2",
        "identifiable": {"gain_N_per_V": {"value": GAIN * 1.01, "u": GAIN * 0.001}},
        "hsd": {"gain_N_per_V": {"value": GAIN * 0.7, "u": GAIN * 0.01}},
    }
    found = compare(static, dynamic)
    assert found["against"]["kv2"]["change"] == pytest.approx(1 / 1.01 - 1)
    assert found["against"]["kv2"]["in_u"] < -9
    assert "disagree" in found["sentence"]
    assert compare(static, {"model": "kv2"})["against"] == {}
