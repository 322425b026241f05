"""A trace and its neighbours: every derivative against central differences of whole traces."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from analysis.model.impact_model import ImpactModel, ShotFrame, model_named

FRAME = ShotFrame(
    1e6,
    900,
    0.6e-3,
    9.80665,
    window_start_s=0.0123,
    radius_m=4.76e-3,
    drop_height_m=0.047,
    coupon_mass_kg=3.6e-3,
)
NAMES = (
    "hsd",
    "kv",
    "hsd+stress_relaxation+dashpot_reaction",
    "kv+stress_relaxation+adhesive_layer+plate_radiation+coupler_highpass+echo",
    "kv+plate_radiation:elastic+coupon_mode+base_compliance",
    "kv+recontact+second_mode+mains_hum",
    "kv+release_speed_bias+mains_hum",
    "kv+sensor_nonlinearity+clipping:soft+amplifier_lowpass",
)
EVERY_CONTACT = (
    "kv+adhesion+finite_thickness+hunt_crossley_damping+stress_relaxation+surface_roughness"
    "+viscoelastic_damping+plate_radiation"
)


def local_of(model: ImpactModel) -> np.ndarray:
    """Return the paper's cell under an acetal sphere, each effect at its first start."""
    own = {
        "ln_K": math.log(1.5e8),
        "ln_S": math.log(5.0),
        "ln_w": math.log(1.08e5),
        "ln_z": math.log(0.07),
        "ln_M": math.log(0.0354),
        "ln_v0": math.log(0.96),
        "ln_e": math.log(0.85),
        "t0_us": 120.37,
        "baseline": 0.01,
    }
    for effect in model.effects:
        for p in effect.parameters:
            own[f"{effect.id}.{p.name}"] = p.coordinate(p.starts[0])
    return np.array([own.get(name, 1e-3) for name in model.names])


@pytest.mark.parametrize("gamma", np.geomspace(0.1, 1.0, 8))
def test_a_neck_begins_without_a_jump(gamma: float) -> None:
    """A weak pull: where its first indentation was rounding, the slope of the trace was that."""
    model = model_named("kv2+adhesion:jkr")
    (at,) = model.places["adhesion:jkr"]
    local = local_of(model)
    local[at] = gamma
    slopes = []
    for step in (1e-3, 1e-6):
        ends = (local.copy(), local.copy())
        for end, sign in zip(ends, (-1.0, 1.0), strict=True):
            end[at] += sign * step
        low, high = (model.predict(end, FRAME, steps=200).signal for end in ends)
        slopes.append((high - low) / (2.0 * step))
    assert slopes[1] == pytest.approx(slopes[0], abs=1e-4 * np.abs(slopes[0]).max())


@pytest.mark.parametrize("name", [*NAMES, EVERY_CONTACT])
def test_every_derivative_is_that_of_whole_traces(name: str) -> None:
    """Signal and rebound move as fourth-order differences of predictions say."""
    model = model_named(name)
    local = local_of(model)
    steps = model.steps(local, FRAME)
    found, jacobian, gradient = model.linearise(local, FRAME)
    plain = model.predict(local, FRAME, steps=steps)
    assert np.allclose(found.signal, plain.signal, rtol=0, atol=1e-13)
    assert found.rebound_ratio == plain.rebound_ratio
    for j, parameter in enumerate(model.names):
        h = 1e-2 if parameter == "t0_us" else 1e-4

        def at(k: int, j: int = j, h: float = h) -> tuple[np.ndarray, float]:
            moved = local.copy()
            moved[j] += k * h
            found = model.predict(moved, FRAME, steps=steps)
            return found.signal, found.rebound_ratio

        points = [at(k) for k in (-2, -1, 1, 2)]
        slope, rebound = (
            (8 * (points[2][i] - points[1][i]) - (points[3][i] - points[0][i])) / (12 * h)
            for i in (0, 1)
        )
        scale = np.abs(found.signal).max()
        # a step of 1e-6 in a frequency is 1e-4 rad after a hundred radians of ring
        assert np.abs(jacobian[:, j] - slope).max() < 1e-4 * max(np.abs(slope).max(), scale)
        assert gradient[j] == pytest.approx(rebound, abs=3e-6)


@pytest.mark.parametrize("name", ["hsd", "kv", "kv2"])
def test_sample_rate_and_gravity_follow_from_the_units(name: str) -> None:
    """Both derivatives are those of whole traces, and with an effect nobody states them."""
    model = model_named(name)
    local, frame = local_of(model), dataclasses.replace(FRAME, coupon_on_crystal_kg=3.6e-3)
    steps, step = model.steps(local, frame), 1e-4
    linear = model.linearise(local, frame)
    known = model.slopes_by_units(local, frame, linear)
    fields = {"time_base": "sample_rate_hz", "gravity": "gravity_m_per_s2"}
    for kind, (slope, rebound) in known.items():
        field = fields.pop(kind)
        ahead, behind = (
            model.predict(
                local,
                dataclasses.replace(frame, **{field: getattr(frame, field) * math.exp(by)}),
                steps=steps,
            )
            for by in (step, -step)
        )
        expected = (ahead.signal - behind.signal) / (2 * step)
        assert np.abs(slope - expected).max() < 1e-4 * max(
            np.abs(expected).max(), np.abs(linear[0].signal).max()
        )
        found = (ahead.rebound_ratio - behind.rebound_ratio) / (2 * step)
        assert rebound == pytest.approx(found, abs=1e-5)
    assert not fields
    hummed = model_named("kv2+mains_hum")
    there = local_of(hummed)
    assert hummed.slopes_by_units(there, frame, hummed.linearise(there, frame)) == {}


@pytest.mark.parametrize("other", ["coupon_mode", "base_compliance"])
def test_a_mass_that_is_not_there_yet_may_come_with_a_second_contact(other: str) -> None:
    """The structure then has fewer masses than that of its neighbours, and the derivative holds."""
    model = model_named(f"kv+{other}+recontact:ringing")
    share = next(e for e in model.effects if e.id == other).parameters[0]
    at, local = model.names.index(f"{other}.{share.name}"), local_of(model)
    local[at] = 0.0
    found, jacobian, _ = model.linearise(local, FRAME)
    local[at] = 1e-5
    ahead = model.predict(local, FRAME).signal
    error = np.abs((ahead - found.signal) / 1e-5 - jacobian[:, at]).max()
    assert error < 1e-3 * np.abs(jacobian[:, at]).max()


def test_an_absurd_point_has_no_trace_and_no_derivative() -> None:
    """Beyond what a float can hold nothing is clamped: the result is not a number."""
    model = model_named("kv+stress_relaxation")
    local = local_of(model)
    local[0] = 900.0
    found, jacobian, gradient = model.linearise(local, FRAME)
    assert math.isnan(found.rebound_ratio)
    assert np.isnan(jacobian).all()
    assert np.isnan(gradient).all()


def test_a_term_that_divides_by_zero_ends_the_trace() -> None:
    """A failing law is told by a rebound that is not a number, not by zeros."""
    model = model_named("kv+stress_relaxation")
    local = local_of(model)
    steps = model.steps(local, FRAME)
    local[model.names.index("stress_relaxation.relaxation_time_s")] = -199.0
    assert math.isfinite(model.predict(local_of(model), FRAME).rebound_ratio)
    assert math.isnan(model.predict(local, FRAME, steps=steps).rebound_ratio)


def test_beyond_the_converters_range_nothing_moves_the_trace() -> None:
    """Trace and derivatives are those without a range, held at its ends and zero there."""
    model = model_named("kv+adhesive_layer")
    local = local_of(model)
    free, slopes, gradient = model.linearise(local, FRAME)
    low, high = 0.3 * free.signal.min(), 0.8 * free.signal.max()
    frame = dataclasses.replace(FRAME, rail=(low, high))
    found, jacobian, same = model.linearise(local, frame)
    beyond = (free.signal > high) | (free.signal < low)
    assert 10 < beyond.sum() < 0.5 * beyond.size
    np.testing.assert_array_equal(found.signal, np.clip(free.signal, low, high))
    np.testing.assert_array_equal(model.predict(local, frame).signal, found.signal)
    np.testing.assert_array_equal(jacobian, np.where(beyond[:, None], 0.0, slopes))
    np.testing.assert_array_equal(same, gradient)


def test_a_range_above_an_amplifiers_ceiling_changes_nothing() -> None:
    """Where the ceiling is an effect of the model, the converter's range lies beyond it."""
    model = model_named("kv+clipping")
    local = local_of(model)
    plain, slopes, _ = model.linearise(local, FRAME)
    railed, held, _ = model.linearise(local, dataclasses.replace(FRAME, rail=(-10.0, 10.0)))
    assert plain.signal.max() == pytest.approx(5.0, abs=0.02)
    np.testing.assert_array_equal(railed.signal, plain.signal)
    np.testing.assert_array_equal(held, slopes)
