"""Campaigns of a shape without a scale: the same pulses at any sampling rate and of any length."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Campaign, Shot, Sphere, Surface

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scale:
    """What a recording is drawn by: only ``sample_rate_hz`` gives it a time at all."""

    sample_rate_hz: float
    contact_samples: int
    quantity: str = "voltage"
    shots: int = 6
    ring_per_contact: float = 3.0
    """Periods of the ring in one contact."""
    damping_ratio: float = 0.05
    pre_contacts: float = 2.0
    post_contacts: float = 8.0
    noise_share: float = 1e-3
    """Of the peak."""
    drop_height_m: float | None = None
    seed: int = 1

    @property
    def label(self) -> str:
        """Return it in a few letters, as a test's id."""
        return f"{self.sample_rate_hz:.3g}Hz-{self.contact_samples}samples-{self.quantity}"


def drawn(seed: int) -> Scale:
    """Return a scale drawn from 50 Hz to 10 MHz and from 5 to 50 000 samples of contact."""
    rng = np.random.default_rng(seed)
    return Scale(
        sample_rate_hz=float(np.exp(rng.uniform(math.log(50.0), math.log(1e7)))),
        contact_samples=round(float(np.exp(rng.uniform(math.log(5.0), math.log(5e4))))),
        quantity=str(rng.choice(["voltage", "acceleration_m_per_s2"])),
        shots=int(rng.integers(6, 11)),
        ring_per_contact=float(np.exp(rng.uniform(math.log(0.7), math.log(8.0)))),
        damping_ratio=float(rng.uniform(0.02, 0.2)),
        pre_contacts=float(rng.uniform(0.3, 4.0)),
        post_contacts=float(rng.uniform(1.5, 15.0)),
        noise_share=float(np.exp(rng.uniform(math.log(1e-4), math.log(1e-2)))),
        drop_height_m=None if rng.uniform() < 0.7 else 0.05,
        seed=seed,
    )


def campaign_at(scale: Scale) -> Campaign:
    """Return shots of a pulse like Hertz's with a ring, of no known mass."""
    rng = np.random.default_rng(scale.seed)
    peak = 2.5 if scale.quantity == "voltage" else 800.0
    shots = tuple(_shot(scale, i, peak, rng) for i in range(scale.shots))
    return Campaign(
        shots=shots, spheres={"ball": Sphere("ball")}, surfaces={"plate": Surface("plate")}
    )


def _shot(scale: Scale, number: int, peak: float, rng: np.random.Generator) -> Shot:
    """Return one shot; sizes and contact times scatter as repeated drops do."""
    contact = scale.contact_samples * (1.0 + 0.02 * rng.standard_normal())
    before = max(4, round(scale.pre_contacts * scale.contact_samples))
    samples = before + max(12, round((1.0 + scale.post_contacts) * scale.contact_samples))
    phase = (np.arange(samples) - before - rng.uniform()) / contact
    push = np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0, 1)), 0.0) ** 1.5
    signal = peak * (1.0 + 0.05 * rng.standard_normal()) * (push + _ring(scale, phase))
    signal += 0.01 * peak + scale.noise_share * peak * rng.standard_normal(samples)
    return Shot(
        name=f"shot{number:03d}",
        signal=signal,
        sample_rate_hz=scale.sample_rate_hz,
        trigger_index=before + max(1, scale.contact_samples // 20),
        quantity=scale.quantity,
        sphere="ball",
        surface="plate",
        drop_height_m=scale.drop_height_m,
    )


def _ring(scale: Scale, phase: Array) -> Array:
    """Return what the structure does from touch-down on, a tenth of the push."""
    turning = 2.0 * math.pi * scale.ring_per_contact * np.maximum(phase, 0.0)
    return np.asarray(0.1 * np.exp(-scale.damping_ratio * turning) * np.sin(turning))
