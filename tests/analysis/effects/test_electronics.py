"""Effects of cables, amplifiers and mains on the sampled signal."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.signal import bessel, butter, lsim

from analysis.aliases import Array
from analysis.effects.amplifier_lowpass import bessel_sections, butterworth_sections
from analysis.effects.library import effect_named
from analysis.model.impact_model import model_named

from .conftest import Rig, apart, simulated

RIG = Rig()
SIGNAL = RIG.predict("kv").signal
PEAK = float(np.abs(SIGNAL).max())
TIMES = np.arange(SIGNAL.size) * 1e-6

AMPLIFIERS = ["amplifier_lowpass", "amplifier_lowpass:second_order", "amplifier_lowpass:bessel"]


def output(name: str, signal: Array, **values: float) -> Array:
    """Return an effect's output."""
    hook = effect_named(name).output
    assert hook is not None
    return hook(signal, values, RIG.context())


@pytest.mark.parametrize("tau", [5e-5, 1e-3, 0.5])
def test_the_coupler_agrees_with_scipy(tau: float) -> None:
    """The high-pass agrees with scipy's exact simulation, in the model as on its own."""
    wanted = lsim(([tau, 0.0], [tau, 1.0]), SIGNAL, TIMES, interp=True)[1]
    found = RIG.predict("kv+coupler_highpass", {"coupler_highpass.time_constant_s": tau}).signal
    assert apart(found, wanted) < 1e-9


def test_the_coupler_forgets_a_step() -> None:
    """A step decays with the time constant; the pulse leaves minus impulse over time constant."""
    tau = 2e-4
    step = np.ones(800)
    step[0] = 0.0
    found = output("coupler_highpass", step, time_constant_s=tau)
    times = np.arange(1, 800) * 1e-6
    assert np.allclose(found[1:] / found[1], np.exp(-(times - 1e-6) / tau), rtol=1e-12)
    pulse = np.where(np.arange(3000) < 100, np.sin(np.pi * np.arange(3000) / 100), 0.0)
    tail = output("coupler_highpass", pulse, time_constant_s=0.1)[110]
    assert tail == pytest.approx(-pulse.sum() * 1e-6 / 0.1, rel=1e-2)


@pytest.mark.parametrize("cutoff", [2e3, 3e4, 2e5, 2e6])
def test_the_amplifier_agrees_with_scipy(cutoff: float) -> None:
    """Both orders, and Bessel's poles, agree with scipy's exact simulation."""
    omega = 2 * math.pi * cutoff
    first = simulated(([1.0], [1 / omega, 1.0]), SIGNAL)
    assert apart(output("amplifier_lowpass", SIGNAL, cutoff_hz=cutoff), first) < 1e-9
    butterworth = ([1.0], [1 / omega**2, math.sqrt(2) / omega, 1.0])
    second = simulated(butterworth, SIGNAL)
    found = output("amplifier_lowpass:second_order", SIGNAL, cutoff_hz=cutoff)
    assert apart(found, second) < 1e-7
    soft = simulated(bessel(2, omega, analog=True, norm="mag"), SIGNAL)
    assert apart(output("amplifier_lowpass:bessel", SIGNAL, cutoff_hz=cutoff), soft) < 1e-7


@pytest.mark.parametrize("name", AMPLIFIERS)
@pytest.mark.parametrize("cutoff", [2e4, 7e4, 3e5])
def test_samples_say_enough_of_a_ring(name: str, cutoff: float) -> None:
    """A ring of 25 kHz at 1 MHz comes out as the steady state does, as straight lines would not.

    Lines between samples lose a part of (2 pi f dt)^2 / 12, 2e-3, of what they say.
    """
    turn = 2 * math.pi * 25e3
    ring = np.sin(turn * TIMES)
    ratio = 1j * 25e3 / cutoff
    soft = ratio / math.sqrt((1 + math.sqrt(5)) / 2)
    gain = {
        "amplifier_lowpass": 1 / (1 + ratio),
        "amplifier_lowpass:second_order": 1 / (1 + math.sqrt(2) * ratio + ratio**2),
        "amplifier_lowpass:bessel": 1 / (1 + math.sqrt(3) * soft + soft**2),
    }[name]
    found = output(name, ring, cutoff_hz=cutoff)[500:-2]
    wanted = (gain * np.exp(1j * turn * TIMES)).imag[500:-2]
    assert np.abs(found - wanted).max() < 1e-4


@pytest.mark.parametrize("name", AMPLIFIERS)
def test_the_cutoff_is_where_the_power_is_half(name: str) -> None:
    """A sine at the cut-off comes out at -3 dB, whatever the order."""
    times = np.arange(20000) * 1e-6
    found = output(name, np.sin(2 * np.pi * 5e3 * times), cutoff_hz=5e3)[4000:]
    assert math.sqrt(2 * float(np.mean(found**2))) == pytest.approx(math.sqrt(0.5), rel=2e-3)


@pytest.mark.parametrize("name", AMPLIFIERS)
def test_the_amplifier_is_smooth_across_neutral(name: str) -> None:
    """Equal steps to both sides of an infinite bandwidth move the trace by opposite amounts."""
    p = effect_named(name).parameters[0]
    up = output(name, SIGNAL, cutoff_hz=p.value(1e-7)) - SIGNAL
    down = output(name, SIGNAL, cutoff_hz=p.value(-1e-7)) - SIGNAL
    assert np.abs(up).max() > 0
    assert np.allclose(up, -down, atol=1e-12 * PEAK)


@pytest.mark.parametrize("cutoff", [8e3, 3e4, 2e5])
@pytest.mark.parametrize("stages", [1, 2, 5])
def test_equal_stages_agree_with_scipy(stages: int, cutoff: float) -> None:
    """Down by 3 dB at the cut-off together; one stage is the effect itself."""
    tau = math.sqrt(2.0 ** (1.0 / stages) - 1.0) / (2 * math.pi * cutoff)
    wanted = SIGNAL
    for _ in range(stages):
        wanted = simulated(([1.0], [tau, 1.0]), wanted)
    found = output("amplifier_lowpass:stages", SIGNAL, cutoff_hz=cutoff, stages=float(stages))
    assert apart(found, wanted) < 1e-5


@pytest.mark.parametrize("order", range(3, 9))
@pytest.mark.parametrize("form", ["butterworth", "bessel"])
def test_a_filter_of_any_order_agrees_with_scipy(form: str, order: int) -> None:
    """Sections one behind the other are scipy's whole filter, in one matrix exponential."""
    for cutoff in (2e4, 1e5, 4e5):
        omega = 2 * math.pi * cutoff
        whole = (
            butter(order, omega, analog=True)
            if form == "butterworth"
            else bessel(order, omega, analog=True, norm="mag")
        )
        found = output(f"amplifier_lowpass:{form}_{order}", SIGNAL, cutoff_hz=cutoff)
        assert apart(found, simulated(whole, SIGNAL)) < 2e-5


def test_sections_are_those_of_the_designers_tables() -> None:
    """Frequency over cut-off and Q = 1 / 2 zeta, as tables for active filters print them."""
    quality = [1 / (2 * z) for _, z in butterworth_sections(4) if z is not None]
    assert sorted(quality) == pytest.approx([0.541, 1.307], abs=5e-4)
    printed = {
        3: [(1.32, None), (1.45, 0.69)],
        4: [(1.43, 0.52), (1.60, 0.81)],
        5: [(1.50, None), (1.56, 0.56), (1.76, 0.92)],
        6: [(1.60, 0.51), (1.69, 0.61), (1.90, 1.02)],
    }
    for order, table in printed.items():
        found = sorted(bessel_sections(order), key=lambda section: section[0])
        for (ratio, zeta), (frequency, q) in zip(found, table, strict=True):
            # tables that are printed to two digits, and not all of them rounded well
            assert ratio == pytest.approx(frequency, abs=0.012)
            assert (zeta is None) == (q is None)
            assert zeta is None or 1 / (2 * zeta) == pytest.approx(q, abs=0.006)


@pytest.mark.parametrize("form", ["butterworth", "bessel"])
def test_orders_one_and_two_are_the_effect_and_its_variant(form: str) -> None:
    """The sections of order 1 are the RC, those of order 2 the forms of old."""
    sections = {"butterworth": butterworth_sections, "bessel": bessel_sections}[form]
    ((alone, none),) = sections(1)
    ((ratio, zeta),) = sections(2)
    assert none is None
    assert alone == pytest.approx(1.0, rel=1e-9)
    wanted = {
        "butterworth": (1.0, math.sqrt(0.5)),
        "bessel": (math.sqrt((1 + math.sqrt(5)) / 2), math.sqrt(0.75)),
    }[form]
    assert (ratio, zeta) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("ratio", [0.05, 0.9, 4.0, 4.1, 30.0])
@pytest.mark.parametrize("tau", [2e-4, 5e-3])
def test_a_coupler_of_two_poles_agrees_with_scipy(tau: float, ratio: float) -> None:
    """It is scipy's exact simulation, whether it swings, creeps, or is just between."""
    back = ratio * tau
    wanted = lsim(([1.0, 0.0, 0.0], [1.0, 1 / tau, 1 / (tau * back)]), SIGNAL, TIMES, interp=True)[
        1
    ]
    found = output("coupler_highpass:two_pole", SIGNAL, time_constant_s=tau, return_time_s=back)
    assert apart(found, wanted) < 1e-8


def test_two_couplers_in_a_row_have_two_poles() -> None:
    """Two RC stages are the form whose rates add and whose return is the sum of both times."""
    one, other = 4e-4, 3e-3
    twice = output("coupler_highpass", SIGNAL, time_constant_s=one)
    twice = output("coupler_highpass", twice, time_constant_s=other)
    found = output(
        "coupler_highpass:two_pole",
        SIGNAL,
        time_constant_s=1 / (1 / one + 1 / other),
        return_time_s=one + other,
    )
    assert apart(found, twice) < 1e-5


def test_a_coupler_without_return_has_one_pole() -> None:
    """The limit of an infinite return is the coupler of the library, and is passed smoothly."""
    first = output("coupler_highpass", SIGNAL, time_constant_s=1e-3)
    name = "coupler_highpass:two_pole"
    limit = output(name, SIGNAL, time_constant_s=1e-3, return_time_s=math.inf)
    assert apart(limit, first) < 1e-12
    p = effect_named(name).parameters[1]
    up, down = (
        output(name, SIGNAL, time_constant_s=1e-3, return_time_s=p.value(step)) - limit
        for step in (1e-5, -1e-5)
    )
    assert np.abs(up).max() > 0
    assert np.allclose(up, -down, rtol=1e-3, atol=1e-9 * PEAK)


def test_a_gain_drifts_with_the_place_in_the_campaign() -> None:
    """A shot's gain is one plus the change times its place; the middle has the base model's."""
    rig = RIG.but(place=-0.5)
    found = rig.predict("kv+gain_drift", {"gain_drift.relative_change": 0.04}).signal
    assert np.allclose(found, 0.98 * SIGNAL, rtol=1e-12)


def test_the_amplifier_delays_and_lowers_the_ring() -> None:
    """The tell-tale: later peak, smaller ring; sharper with the second order."""
    values = {"amplifier_lowpass.cutoff_hz": 2e4}
    found = RIG.predict("kv+amplifier_lowpass", values).signal
    assert np.argmax(found) > np.argmax(SIGNAL)
    assert np.abs(np.diff(found[320:])).max() < 0.9 * np.abs(np.diff(SIGNAL[320:])).max()


def test_clipping_is_a_minimum() -> None:
    """Hard clipping is min(V, V_c); the soft form comes to it as its bend narrows."""
    ceiling = 0.7 * PEAK
    hard = RIG.predict("kv+clipping", {"clipping.ceiling_v": ceiling}).signal
    assert np.array_equal(hard, np.minimum(SIGNAL, ceiling))
    assert np.count_nonzero(hard == ceiling) > 10
    ramp = np.linspace(0.0, 2 * ceiling, 5001)
    gaps = [
        np.abs(
            output("clipping:soft", ramp, ceiling_v=ceiling, softness=w) - np.minimum(ramp, ceiling)
        ).max()
        for w in (1e-2, 1e-3)
    ]
    assert gaps[0] == pytest.approx(1e-2 * ceiling * math.log(2), rel=1e-3)
    assert gaps[1] == pytest.approx(gaps[0] / 10, rel=1e-3)


def test_an_amplifier_clips_on_both_sides() -> None:
    """The swing back is cut like the pulse; the rational form has its closed values and limits."""
    ceiling = 0.2 * float(-SIGNAL.min())
    both = output("clipping:both_sides", SIGNAL, ceiling_v=ceiling)
    assert both.max() == ceiling == -both.min()
    assert np.array_equal(both[np.abs(SIGNAL) < ceiling], SIGNAL[np.abs(SIGNAL) < ceiling])
    for s in (0.02, 0.1, 0.5):
        found = output("clipping:rational", SIGNAL, ceiling_v=ceiling, softness=s)
        at_ceiling = output("clipping:rational", np.full(1, ceiling), ceiling_v=ceiling, softness=s)
        closed = SIGNAL / (1 + np.abs(SIGNAL / ceiling) ** (1 / s)) ** s
        assert np.allclose(found, closed, rtol=1e-12, atol=0.0)
        assert at_ceiling[0] == pytest.approx(ceiling * 2**-s, rel=1e-12)
    sharp = output("clipping:rational", SIGNAL, ceiling_v=ceiling, softness=1e-3)
    assert np.abs(sharp - both).max() < 1e-3 * ceiling


@pytest.mark.parametrize("delay_us", [0.4, 1.0, 2.7, 13.0, 47.31])
def test_an_echo_is_a_delayed_copy(delay_us: float) -> None:
    """A delay of any part of a sample is right to 1e-5 on a 20 kHz signal at 1 MHz."""

    def burst(t: Array) -> Array:
        return np.exp(-(((t - 300e-6) / 60e-6) ** 2)) * np.sin(2 * np.pi * 20e3 * t)

    found = output("echo", burst(TIMES), strength=0.5, delay_s=delay_us * 1e-6)
    wanted = burst(TIMES) + 0.5 * burst(TIMES - delay_us * 1e-6)
    assert np.abs(found - wanted).max() < 1e-5


def test_an_echo_reaches_both_ends_of_the_record() -> None:
    """Before the record the signal rested on its first value; near its end nothing is invented."""
    ramp = np.maximum(np.arange(40.0) - 20.0, 0.0)
    found = output("echo", ramp, strength=1.0, delay_s=0.5e-6)
    assert found[-6:] == pytest.approx(2 * ramp[-6:] - 0.5, abs=1e-9)
    resting = np.full(30, 2.0)
    assert output("echo", resting, strength=0.1, delay_s=7.3e-6) == pytest.approx(2.2 * np.ones(30))
    assert output("echo", resting, strength=0.1, delay_s=1.0) == pytest.approx(2.2 * np.ones(30))


def test_an_echo_of_the_model_is_a_later_impact() -> None:
    """The model's echo is the model itself with a later touch-down, added."""
    values = {"echo.strength": 0.1, "echo.delay_s": 11.4e-6}
    found = RIG.predict("kv+echo", values).signal
    later = RIG.but(touch_down_us=RIG.touch_down_us + 11.4).predict("kv").signal
    assert apart(found, SIGNAL + 0.1 * later) < 2e-5


@pytest.mark.parametrize(("name", "mains"), [("mains_hum", 50.0), ("mains_hum:60_hz", 60.0)])
def test_hum_of_any_phase_is_in_the_span(name: str, mains: float) -> None:
    """Three harmonics of any size and phase, over any window, are sums of columns and baseline.

    Over a short one to some thousandths, and so is a chain of odd ones.
    """
    effect = effect_named(name)
    assert effect.basis is not None
    rng = np.random.default_rng(3)
    for samples, start in ((1500, 0.0), (4000, 0.05), (6000, 0.0123), (40000, 0.2)):
        columns = effect.basis(samples, dataclasses.replace(RIG.context(), window_start_s=start))
        assert columns.shape == (samples, effect.basis_size)
        t = start + np.arange(samples) * 1e-6
        hum = sum(
            rng.uniform(0.01, 0.03) * np.sin(2 * np.pi * h * mains * t + rng.uniform(0, 6.28))
            for h in (1, 2, 3)
        )
        odd = sum(
            0.02 / h * np.sin(2 * np.pi * h * mains * t + rng.uniform(0, 6.28))
            for h in (1, 3, 5, 7)
        )
        full = np.column_stack([columns, np.ones(samples)])
        short = samples < 5000
        for signal, least in ((hum, 1e-4 if short else 1e-9), (odd, 1e-4 if short else 0.02)):
            left = signal - full @ np.linalg.lstsq(full, signal, rcond=None)[0]
            assert np.std(left) < least
            assert short or signal is odd or np.abs(left).max() < 1e-9
        gram = full.T @ full / samples
        assert np.allclose(gram, np.eye(gram.shape[0]), atol=1e-8)


def test_hum_is_free_in_every_shot() -> None:
    """The columns are nuisances of the shot; size 1 is an rms of 1, before the trigger too."""
    model = model_named("kv+mains_hum")
    local = RIG.local(model)
    local[model.names.index("mains_hum.basis0")] = 1.0
    added = model.predict(local, RIG.frame(), steps=RIG.steps(model, local)).signal - SIGNAL
    assert math.sqrt(float(np.mean(added**2))) == pytest.approx(1.0, rel=1e-9)
    assert np.abs(added[:150]).max() > 0.1


def test_outputs_follow_the_signals_way() -> None:
    """However they are named, the sensor comes first, the ceiling last."""
    values = {
        "coupler_highpass.time_constant_s": 1e-3,
        "amplifier_lowpass.cutoff_hz": 3e4,
        "clipping.ceiling_v": 0.5 * PEAK,
        "sensor_nonlinearity.curvature_per_v": 0.02,
    }
    names = ["clipping", "amplifier_lowpass", "sensor_nonlinearity", "coupler_highpass"]
    one = RIG.predict("+".join(["kv", *names]), values).signal
    two = RIG.predict("+".join(["kv", *reversed(names)]), values).signal
    assert np.array_equal(one, two)
    assert one.max() == 0.5 * PEAK
    bent = SIGNAL + 0.02 * SIGNAL**2
    passed = output("coupler_highpass", bent, time_constant_s=1e-3)
    wanted = np.minimum(output("amplifier_lowpass", passed, cutoff_hz=3e4), 0.5 * PEAK)
    assert apart(one, wanted) < 1e-12
