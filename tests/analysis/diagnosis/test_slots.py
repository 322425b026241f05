"""Slots are told by what generic families explain; frequencies and groups are found as stated."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.diagnosis.basis.columns import Scale
from analysis.diagnosis.basis.groups import groups
from analysis.diagnosis.basis.oscillation import TUNED, best_damped, best_frequency, tuned_columns
from analysis.diagnosis.basis.slot_columns import OF_SIGNAL, mount_columns
from analysis.diagnosis.localisation.slot_physics import SHARES, physical_score
from analysis.diagnosis.localisation.slot_table import CENTRE, SLOT_NAMES, SPREAD, WEIGHTS
from analysis.diagnosis.localisation.slots import (
    BANK,
    FAMILIES,
    explained_by_family,
    features,
    probabilities,
    slow_power,
)
from analysis.diagnosis.score_test.linearised import linearise

RATE = 1e6


@pytest.fixture(scope="module")
def answers(leaky):
    """What the bank says of a campaign through a leaky coupler."""
    first = leaky.steps[0]
    return explained_by_family(linearise(first.problem, first.fitted, wanted=FAMILIES))


def test_probabilities_are_of_five_slots_and_sum_to_one(leaky, answers):
    """Whatever the answers, one of the slots it is."""
    found = probabilities(features(answers, leaky.steps[0].problem.shots))
    assert sorted(found) == ["contact", "electronics", "mounting", "release", "sensor"]
    assert math.isclose(sum(found.values()), 1.0)
    assert min(found.values()) >= 0.0


def test_every_feature_has_its_column_in_the_table(leaky, answers):
    """A family without an answer counts as explaining nothing."""
    shots = leaky.steps[0].problem.shots
    assert features(answers, shots).shape == (len(BANK) + 2,)
    assert np.all(np.isfinite(features({}, shots)))


def test_the_table_has_a_column_for_every_feature():
    """And a row for every slot."""
    assert WEIGHTS.shape == (len(SLOT_NAMES), len(BANK) + 2)
    assert CENTRE.shape == SPREAD.shape == (len(BANK) + 2,)
    assert np.all(SPREAD > 0.0)


def test_every_family_but_the_generic_one_is_the_work_of_some_slot():
    """``locked`` follows anything that is in step with the impact."""
    assert {family for family, _ in BANK} - set(SHARES) == {"locked"}
    assert all(max(shares) > 0.0 for shares in SHARES.values())


def test_the_work_of_one_slot_speaks_for_it_and_a_shared_one_for_both():
    """Speeds that contradict heights are the release's; a curve may be crystal or converter."""
    families = ("locked", "speed", "curve", "stiffness")
    assert physical_score(np.array([2.0, 1.0, 0.1, 0.1]), families).argmax() == 0
    found = physical_score(np.array([2.0, 0.1, 1.0, 0.9]), families)
    score = dict(zip(SLOT_NAMES, found, strict=True))
    assert score["sensor"] == score["electronics"] == 1.0
    assert score["contact"] == pytest.approx(0.9**4)


def test_what_explains_next_to_nothing_speaks_for_nobody():
    """A hundredth of a decade is no explanation."""
    assert np.all(physical_score(np.array([0.01, 0.0]), ("speed", "gain")) < 1e-4)


def test_quiet_stretches_of_plain_noise_have_no_unrest(clean):
    """The slowest part of white noise is as strong as any other."""
    assert slow_power(clean.steps[0].problem.shots) == pytest.approx(1.0, abs=0.35)


def test_an_oscillation_before_the_trigger_is_unrest(clean):
    """A slow swing of the noise's size stands out of its slowest part."""
    rng = np.random.default_rng(5)
    swinging = []
    for item in clean.steps[0].problem.shots:
        t = np.arange(item.shot.signal.size) / item.shot.sample_rate_hz
        swing = item.noise.rms * np.sin(2 * math.pi * 1500.0 * t + rng.uniform(0.0, 6.0))
        record = dataclasses.replace(item.shot, signal=item.shot.signal + swing)
        swinging.append(dataclasses.replace(item, shot=record))
    assert slow_power(swinging) > 5.0


@pytest.mark.parametrize("family", sorted(TUNED))
def test_a_shared_frequency_is_found_whatever_the_phases(family):
    """Sizes and phases differ from shot to shot, the frequency does not."""
    rng = np.random.default_rng(11)
    t = np.arange(2000) / RATE
    truth = TUNED[family][20]
    signals, residuals = [], []
    for _ in range(4):
        pulse = np.exp(-(((t - 3e-4) / 2e-5) ** 2)) + 0.0 * t
        columns = tuned_columns(family, pulse, RATE, truth)
        signals.append(pulse)
        residuals.append(columns @ rng.standard_normal(2))
    assert best_frequency(family, signals, residuals, [RATE] * 4) == truth


def test_a_shared_damping_is_found_with_its_frequency():
    """A resonance that dies within a period or two is no mode of a twentieth's damping."""
    rng = np.random.default_rng(12)
    t = np.arange(2000) / RATE
    pulses = [np.exp(-(((t - 3e-4) / width) ** 2)) for width in (2e-5, 3e-5, 4e-5)]
    w = 2.0 * np.pi * 783.0
    residuals = []
    for pulse in pulses:
        size, phase = rng.uniform(0.5, 2.0), rng.uniform(0.0, 2.0 * np.pi)
        response = size * np.exp(-0.27 * w * t) * np.cos(w * t + phase)
        residuals.append(np.convolve(pulse, response)[: t.size])
    frequency, zeta = best_damped(pulses, residuals, [RATE] * 3)
    assert frequency == pytest.approx(783.0, rel=0.01)
    assert zeta == pytest.approx(0.27, rel=0.02)


def test_an_echo_that_disperses_is_a_free_impulse_response():
    """Three delayed copies, each smeared: one response for pulses of any width."""
    t = np.arange(2000) / RATE
    scale = Scale(1.0, 1e-5, 0.5, 5e-5, 1e-4, 2e-3)
    copies = ((0.1, 90), (-0.05, 400), (0.02, 800))

    def late(pulse):
        smeared = np.convolve(pulse, np.ones(16) / 16.0)
        return sum(a * np.roll(smeared, d)[: t.size] for a, d in copies)

    pulses = [np.exp(-(((t - 3e-4) / width) ** 2)) for width in (2e-5, 3e-5, 4e-5)]
    columns = [OF_SIGNAL["impulse"](pulse, RATE, scale)[1] for pulse in pulses]
    wanted = [late(pulse) for pulse in pulses]
    learned = np.linalg.lstsq(np.vstack(columns[:2]), np.concatenate(wanted[:2]), rcond=1e-9)[0]
    left = wanted[2] - columns[2] @ learned
    assert np.linalg.norm(left) < 0.1 * np.linalg.norm(wanted[2])


@pytest.mark.parametrize(
    ("force", "law"),
    [
        ("x^2", lambda x, v: x * x),
        ("|x|", lambda x, v: abs(x)),
        ("v |x|", lambda x, v: v * abs(x)),
        ("x^3", lambda x, v: x**3),
    ],
)
def test_a_bent_spring_or_damper_is_what_an_integration_of_it_gives(force, law):
    """A small force on an oscillator, integrated to 1e-10, against its column."""
    omega, zeta, share = 2 * math.pi * 17.3e3, 0.07, 1e-3
    t = np.arange(800) / RATE

    def motion(small):
        def slopes(at, y):
            x, v = y[0], y[1] / omega
            push = math.exp(-(((at - 1.5e-4) / 3e-5) ** 2)) + small * law(x, v)
            return [y[1], omega**2 * (push - x) - 2 * zeta * omega * y[1]]

        ran = solve_ivp(slopes, (0, t[-1]), [0, 0], t_eval=t, rtol=1e-10, atol=1e-13, max_step=1e-6)
        return ran.y[0]

    plain = motion(0.0)
    labels, columns = mount_columns(plain, RATE, 1.0, (omega, zeta))
    wanted = (motion(share) - motion(-share)) / (2 * share)
    found = 10.0 * columns[:, labels.index(f"crystal force {force}")]
    assert np.linalg.norm(found - wanted) < 0.01 * np.linalg.norm(wanted)


def test_owners_with_a_speed_have_a_second_coefficient_that_sums_to_little(clean):
    """It stands for the change with the logarithm of the speed, from the usual one on."""
    problem = clean.steps[0].problem
    found = groups(problem, "pair speed")
    assert {len(own) for own in found} == {2}
    for own, item in zip(found, problem.shots, strict=True):
        assert own[0] == (item.pair, 1.0)
        assert abs(own[1][1]) < 1.0


def test_a_drift_has_a_trend_from_minus_one_to_one(clean):
    """Whatever the number of shots."""
    found = groups(clean.steps[0].problem, "drift")
    assert dict(found[0])["trend"] == -1.0
    assert dict(found[-1])["trend"] == 1.0
