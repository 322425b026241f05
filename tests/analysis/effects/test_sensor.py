"""Effects that the cell itself has on what it reads."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import residue

from analysis.aliases import Array
from analysis.effects.library import effect_named
from analysis.effects.resonance import free_oscillation, resonance

from .conftest import Rig, apart, simulated

RIG = Rig()
SIGNAL = RIG.predict("kv").signal


def second_order(signal: Array, frequency: float, zeta: float) -> Array:
    """Return the resonance's response by scipy, for a signal that is a parabola between samples."""
    omega = 2 * math.pi * frequency
    return simulated(([omega**2], [1.0, 2 * zeta * omega, omega**2]), signal)


@pytest.mark.parametrize("zeta", [0.01, 0.3, 0.9999999, 1.0, 1.0000001, 2.5])
@pytest.mark.parametrize("frequency", [2e3, 4e4, 4e5])
def test_the_resonance_is_exact_between_samples(frequency: float, zeta: float) -> None:
    """Any damping and frequency agree with scipy's exact simulation."""
    found = resonance(SIGNAL, 2 * math.pi * frequency * 1e-6, zeta)
    wanted = second_order(SIGNAL, frequency, zeta)
    assert np.abs(found - wanted).max() < 1e-7 * np.abs(SIGNAL).max()


def test_the_resonance_starts_at_rest_and_ends_in_its_input() -> None:
    """A constant passes unchanged; an infinitely fast resonance is the input, a fast one delays."""
    assert np.allclose(resonance(np.full(50, 3.0), 0.3, 0.1), 3.0, rtol=1e-13)
    assert np.allclose(resonance(SIGNAL, math.inf, 0.5), SIGNAL, rtol=0, atol=1e-15)
    ramp = np.arange(60.0)
    assert resonance(ramp, 400.0, 0.8)[-1] == pytest.approx(59 - 2 * 0.8 / 400, abs=1e-9)
    assert resonance(ramp, -400.0, 0.8)[-1] == pytest.approx(59 + 2 * 0.8 / 400, abs=1e-9)


def test_the_propagator_has_the_damping_of_its_determinant() -> None:
    """Liouville: the determinant of the propagator is exp(-2 zeta angle)."""
    for zeta in (0.1, 1.0, 3.0):
        a, b, c, d = free_oscillation(0.7, zeta)
        assert a * d - b * c == pytest.approx(math.exp(-1.4 * zeta), rel=1e-12)


def test_a_second_mode_adds_its_share() -> None:
    """V + beta G2 V agrees with scipy, in the model as on its own."""
    values = {
        "second_mode.share": 0.1,
        "second_mode.frequency_hz": 45e3,
        "second_mode.damping_ratio": 0.02,
    }
    found = RIG.predict("kv+second_mode", values).signal
    assert apart(found, SIGNAL + 0.1 * second_order(SIGNAL, 45e3, 0.02)) < 1e-8


def test_a_second_mode_is_driven_by_the_crystal_not_by_the_force() -> None:
    """Residues of G1 (1 + beta G2): the second mode's is beta G1 at its pole, and not free."""
    (w1, z1), (w2, z2), beta = (2 * math.pi * 17.3e3, 0.07), (2 * math.pi * 45e3, 0.02), 0.1
    one, two = ([1.0, 2 * z * w, w**2] for w, z in ((w1, z1), (w2, z2)))
    above = w1**2 * np.polyadd(two, [beta * w2**2])
    residues, poles, _ = residue(above, np.polymul(one, two))
    at = int(np.argmax(poles.imag))
    g1 = w1**2 / np.polyval(one, poles[at])
    assert residues[at] == pytest.approx(beta * g1 * w2**2 / (2j * poles[at].imag), rel=1e-9)
    # a mode that the force drives beside the crystal would have its part in phase with beta
    assert g1.real == pytest.approx(-1 / ((45 / 17.3) ** 2 - 1), rel=0.05)


def test_a_second_mode_beats_on_the_ring() -> None:
    """The tell-tale: after the pulse there is a second line in the spectrum."""
    values = {"second_mode.frequency_hz": 45e3, "second_mode.damping_ratio": 0.005}

    def line(signal: Array) -> float:
        tail = signal[320:1400]
        spectrum = np.abs(np.fft.rfft(tail * np.hanning(tail.size)))
        return float(spectrum[round(45e3 * 1080e-6)] / spectrum.max())

    found = RIG.predict("kv+second_mode", values | {"second_mode.share": 0.3}).signal
    assert line(found) > 5 * line(SIGNAL)


def test_a_curved_characteristic_bends_the_peak() -> None:
    """V + b V^2, largest at the peak."""
    found = RIG.predict("kv+sensor_nonlinearity", {"sensor_nonlinearity.curvature_per_v": 0.02})
    assert apart(found.signal, SIGNAL + 0.02 * SIGNAL**2) < 1e-12
    misfit = found.signal - SIGNAL
    assert np.argmax(misfit) == np.argmax(SIGNAL)


def test_crystal_dynamics_is_the_other_base() -> None:
    """The crystal has no hook: it names the base that it makes of a rigid cell."""
    effect = effect_named("crystal_dynamics")
    assert effect.replaces_base == "kv"
    assert effect.bases == ("hsd",)
    assert [p.name for p in effect.parameters] == ["natural_frequency_hz", "damping_ratio"]
    assert not effect.in_solver
    assert effect.output is None
