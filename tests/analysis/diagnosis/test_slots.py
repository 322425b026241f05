"""Slots are told by what generic families explain; frequencies and groups are found as stated."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from analysis.diagnosis.basis.groupings import groups
from analysis.diagnosis.basis.linear_filter import (
    TUNED,
    best_damped,
    best_frequency,
    impulse_columns,
    tuned_columns,
)
from analysis.diagnosis.basis.nonlinearity import mount_columns
from analysis.diagnosis.discrepancy.choice import BEYOND_FIRST_ORDER
from analysis.diagnosis.linearised import linearise
from analysis.diagnosis.slots import (
    BANK,
    FAMILIES,
    SHARES,
    explained_by_family,
    probabilities,
    worth,
)

RATE = 1e6


@pytest.fixture(scope="module")
def answers(leaky):
    """What the bank says of a campaign through a leaky coupler."""
    first = leaky.steps[0]
    return explained_by_family(linearise(first.problem, first.fitted, wanted=FAMILIES))


def test_probabilities_are_of_five_slots_and_sum_to_one(answers):
    """Whatever the answers, one of the slots it is."""
    found = probabilities({part: worth(answer) for part, answer in answers.items()}, 1e4, 4)
    assert sorted(found) == ["contact", "electronics", "mounting", "release", "sensor"]
    assert math.isclose(sum(found.values()), 1.0)
    assert min(found.values()) >= 0.0


def test_every_family_but_the_generic_one_is_the_work_of_some_slot():
    """``locked`` follows anything that is in step with the impact."""
    asked = {family for family, _ in (*BANK, *BEYOND_FIRST_ORDER)}
    assert asked - set(SHARES) == {"locked"}
    assert set(SHARES) <= asked
    assert all(max(shares) > 0.0 for shares in SHARES.values())


def test_the_work_of_one_slot_speaks_for_it_and_a_shared_one_for_both():
    """Speeds that contradict heights are the release's; a curve may be crystal or converter."""
    speed = {("locked", "rig"): 9e4, ("speed", "shot"): 8e4, ("curve", "rig"): 1e3}
    assert probabilities(speed, 9e4, 9)["release"] > 0.95
    curve = probabilities({("speed", "shot"): 1e3, ("curve", "rig"): 9e4}, 9e4, 9)
    assert curve["sensor"] == curve["electronics"] > 0.45


def test_where_nothing_explains_much_no_slot_is_likely():
    """A family that explains a hundredth is no answer, even where the others explain less."""
    found = probabilities(dict.fromkeys(BANK, 0.0) | {("contact", "rig"): 900.0}, 9e4, 9)
    assert max(found.values()) < 0.3
    assert set(probabilities({}, 9e4, 9).values()) == {0.2}


def test_what_explains_alike_is_as_likely_and_one_pair_is_one_piece_of_evidence():
    """Shares of 59, 60 and 63 % of one pair's squares are no reason to choose."""
    alike = {("contact", "rig"): 0.59e4, ("droop", "rig"): 0.60e4, ("seat", "rig"): 0.63e4}
    few, many = (probabilities(alike, 1e4, pairs) for pairs in (1, 9))
    assert few["contact"] / few["mounting"] == pytest.approx((0.39 / 0.43) ** 0.5, rel=0.01)
    assert many["contact"] / many["mounting"] == pytest.approx((0.39 / 0.43) ** 4.5, rel=0.01)


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
    copies = ((0.1, 90), (-0.05, 400), (0.02, 800))

    def late(pulse):
        smeared = np.convolve(pulse, np.ones(16) / 16.0)
        return sum(a * np.roll(smeared, d)[: t.size] for a, d in copies)

    pulses = [np.exp(-(((t - 3e-4) / width) ** 2)) for width in (2e-5, 3e-5, 4e-5)]
    columns = [impulse_columns(pulse, RATE)[1] for pulse in pulses]
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
