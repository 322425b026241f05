"""The fit window: where the pulse is, either way up, and at the edges of a record."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from analysis.campaign import Shot
from analysis.errors import ShotRejectedError
from analysis.fit.window import calm_share, campaign_noise, cut, quiet_part


@pytest.fixture
def shot(truth: Any) -> Shot:
    """Return one recording of 4200 samples, touched near sample 900."""
    return truth(seed=3).shot("acetal", "polycarbonate", 0.03, 0.8)


def test_window_holds_pulse_and_ring(shot: Shot) -> None:
    """The window starts well before the touch and ends after the ring."""
    window = cut(shot)
    touch = 900 - window.first
    assert window.rise_index == pytest.approx(touch, abs=25)
    assert touch > 300
    assert window.signal.size - touch > 2000
    assert window.peak == pytest.approx(shot.signal.max() - 0.01, abs=0.01)
    assert window.baseline == pytest.approx(0.01, abs=0.001)
    assert 2e-5 < window.width_s < 2e-4
    assert window.polarity == 1


def test_inverted_records_are_turned_round(shot: Shot) -> None:
    """A record with compression negative gives the same window, marked as inverted."""
    upright, inverted = cut(shot), cut(dataclasses.replace(shot, signal=-shot.signal))
    assert inverted.polarity == -1
    assert inverted.first == upright.first
    np.testing.assert_array_equal(inverted.signal, upright.signal)
    assert inverted.baseline == upright.baseline


def test_the_end_tells_the_noise_where_no_record_has_a_beginning(shot: Shot) -> None:
    """Cut off at touch-down, a record still has what comes after the ring."""
    whole = campaign_noise([shot])
    late = [dataclasses.replace(shot, signal=shot.signal[905:], trigger_index=0)]
    found = campaign_noise(late)
    assert (whole.source, found.source) == ("pre-trigger", "end")
    assert found.is_measured
    assert found.rms == pytest.approx(whole.rms, rel=0.1)


def test_a_ring_to_the_end_is_no_noise(shot: Shot) -> None:
    """The level is then a guess, from differences of neighbouring samples."""
    short = [dataclasses.replace(shot, signal=shot.signal[905:1400], trigger_index=0)]
    found = campaign_noise(short)
    assert found.source == "differences"
    assert not found.is_measured


def swinging(first: float, sign: float) -> Shot:
    """Return a push of that height at sample 1500, 50 samples wide, before larger swings."""
    x = np.zeros(4000)
    for i, size in enumerate((first, -1.1, 1.0, -0.9, 0.8)):
        x[1500 + 50 * i : 1550 + 50 * i] = size * np.sin(np.pi * np.arange(50) / 50)
    noise = 1e-3 * np.random.default_rng(8).standard_normal(x.size)
    return Shot("shot 19", sign * 5.0 * x + noise, 1e6, 1510)


@pytest.mark.parametrize("first", [0.4, 1.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_swing_back_larger_than_the_push_is_not_the_contact(first: float, sign: float) -> None:
    """What a ringing structure does later moves neither touch-down nor polarity."""
    window = cut(swinging(first, sign))
    assert window.polarity == sign
    assert window.first + window.rise_index == pytest.approx(1501, abs=1)
    assert window.first + window.peak_index == pytest.approx(1525, abs=2)
    assert window.width_s == pytest.approx(48e-6, abs=2e-6)
    assert window.peak == pytest.approx(5.0, rel=1e-3)
    assert quiet_part(swinging(first, sign)).size < 1500


def test_a_swing_cut_at_both_ends_of_the_range_keeps_its_sign() -> None:
    """Codes reach one further down than up, which must not turn a record round."""
    cut_off = swinging(1.0, 1.0)
    rails = np.clip(cut_off.signal, -2.0 - 1 / 16384, 2.0)
    assert cut(dataclasses.replace(cut_off, signal=rails)).polarity == 1


def test_pulse_at_the_start_of_a_record(shot: Shot) -> None:
    """A record that starts inside the rise is cut at its first sample."""
    late = dataclasses.replace(shot, signal=shot.signal[915:], trigger_index=0)
    window = cut(late)
    assert window.first == 0
    assert window.peak_index < 100
    assert window.peak > 0.9 * cut(shot).peak


def test_pulse_at_the_end_of_a_record(shot: Shot) -> None:
    """A record that ends inside the pulse is cut at its last sample."""
    early = dataclasses.replace(shot, signal=shot.signal[:930])
    window = cut(early)
    assert window.first + window.signal.size == 930
    assert window.peak > 0


def test_trigger_off_by_a_millisecond_still_finds_the_pulse(shot: Shot) -> None:
    """The trigger index only has to be near: before or a little after the touch."""
    expected = cut(shot).first
    for off in (-800, -200, 300):
        moved = dataclasses.replace(shot, trigger_index=shot.trigger_index + off)
        assert cut(moved).first == expected


@pytest.mark.parametrize("level", [0.0, 0.3])
def test_a_record_without_pulse_is_rejected(level: float) -> None:
    """A flat record is refused with its name and where it was looked for."""
    flat = Shot("shot 17", np.full(3000, level), 1e6, 1000)
    with pytest.raises(ShotRejectedError, match=r"shot 17: .*trigger"):
        cut(flat)


def test_noise_alone_is_no_pulse() -> None:
    """A record that never leaves its own noise is refused, not fitted."""
    noise = 1e-3 * np.random.default_rng(5).standard_normal(8000)
    with pytest.raises(ShotRejectedError, match="noise"):
        cut(Shot("shot 18", noise, 1e6, 4000))


def test_quiet_part_ends_before_the_touch(shot: Shot) -> None:
    """The samples that noise is learned from hold no contact."""
    quiet = quiet_part(shot)
    assert 800 < quiet.size < 900
    assert np.abs(quiet - 0.01).max() < 0.01


def test_a_precursor_is_no_noise() -> None:
    """What rises before every pulse is left out of the noise; hum of any phase is not."""
    rng = np.random.default_rng(4)
    noise = 10.0 * rng.standard_normal((22, 165))
    rises = 250.0 * np.exp((np.arange(165) - 165) / 12.0)
    assert 0.5 <= calm_share(noise + rises) < 1.0
    assert calm_share(noise) == 1.0
    phase = 2 * np.pi * (rng.uniform(size=(22, 1)) + np.arange(165) / 3000.0)
    assert calm_share(noise + 400.0 * np.sin(phase)) == 1.0


def test_the_noise_of_board_impacts_is_that_of_their_quiet_start(shared_campaign: Any) -> None:
    """Recordings with a precursor have a noise of about 11 m/s^2, not of 97."""
    campaign, _ = shared_campaign("data/board-impacts")
    found = campaign_noise(list(campaign.shots))
    assert 8.0 < found.rms < 15.0
    assert found.calm_share < 1.0
