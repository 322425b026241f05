"""What records hold before touch-down and behind the pulse is said in words."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import firwin, lfilter

from analysis.campaign import Campaign, Shot
from analysis.diagnosis.document.before_and_after import said_before_and_after
from analysis.fit.problem import build
from analysis.model.impact_model import model_named

RATE_HZ, SAMPLES, TRIGGER = 1e5, 2000, 400


def said(filtered: str, hits: int = 5, noise: float = 1e-4) -> str:
    """Return what is said of pulses behind a filter."""
    rng = np.random.default_rng(4)
    t = (np.arange(SAMPLES) - TRIGGER) / RATE_HZ
    shots = []
    for number in range(hits):
        pulse = np.where((t > 0) & (t < 3e-4), np.sin(np.pi * t / 3e-4), 0.0) ** 1.5
        signal = rng.uniform(0.7, 1.3) * pulse
        if filtered == "linear phase":
            taps = firwin(41, 0.2)
            signal = np.roll(np.asarray(lfilter(taps, 1.0, signal)), -20)
        if filtered == "high-pass":
            decay = np.exp(-1.0 / (0.2 * RATE_HZ))
            signal = np.asarray(lfilter([1.0, -1.0], [1.0, -decay], signal))
        signal = signal + rng.normal(0.0, noise, SAMPLES)
        shots.append(Shot(f"hit {number}", signal, RATE_HZ, TRIGGER, quantity="force_N"))
    problem = build(Campaign(tuple(shots)), model_named("hsd"))
    return " ".join(said_before_and_after(problem.shots))


def test_a_clean_pulse_leaves_nothing_to_say() -> None:
    """Neither before nor after."""
    assert not said("none")


def test_what_comes_before_its_cause_is_said() -> None:
    """A filter of linear phase rings on both sides."""
    assert "a zero-phase or linear-phase filter, or a precursor" in said("linear phase")


@pytest.mark.parametrize("noise", [1e-5, 5e-4])
def test_a_droop_of_a_tenth_of_a_per_cent_is_said(noise: float) -> None:
    """With the time constant that leaves it: 0.2 s, of which the pulse is a thousandth."""
    words = said("high-pass", noise=noise)
    assert "% of the peak below their level before it" in words
    assert "a high-pass of about" in words
    constant_ms = float(words.split("a high-pass of about ")[1].split(" ms")[0])
    assert constant_ms == pytest.approx(200.0, rel=0.15)


def test_two_hits_say_nothing() -> None:
    """Of two nobody knows what is alike in all."""
    assert not said("linear phase", hits=2)
