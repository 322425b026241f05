"""A rig that is exactly what its labels say, and drops on it without noise."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray

from drivers.simulated.draw import draw_rig
from drivers.simulated.drawn_rig import DrawnRig
from drivers.simulated.effects import Effect, Scope, Shot, make_effect
from drivers.simulated.flight import Touch, begin_flight, render_flight
from drivers.simulated.impact import Mechanics
from drivers.simulated.specimens import SPHERES, SURFACES, CellSpec


class Lab:
    """A laboratory without noise."""

    RATE_HZ = 1e6
    BEFORE = 100
    TOUCH_AT = 100.5  # sample at which the sphere touches

    def a_rig(
        self, *effects: Effect, cell: str = "kv", restitution: float | None = None
    ) -> DrawnRig:
        """Return a rig that is exactly what its labels say."""
        given = (
            {} if restitution is None else {(a, b): restitution for a in SPHERES for b in SURFACES}
        )
        return draw_rig(
            3,
            SPHERES,
            SURFACES,
            CellSpec(),
            effects,
            exact=True,
            restitution=given,
            restitution_scatter=0.0,
            rigid_cell=cell == "hsd",
        )

    def drop(
        self,
        rig: DrawnRig,
        height_m: float = 0.03,
        *,
        sphere: str = "acetal",
        surface: str = "polycarbonate",
        samples: int = 3000,
        number: int = 1,
    ) -> tuple[NDArray[np.float64], Touch]:
        """Return a noiseless record on a grid that does not follow the landing, and its touch."""
        shot = Shot(number, sphere, surface, height_m, np.random.default_rng(0))
        flight = begin_flight(rig, shot, 0.0, 0.0, (9, number))
        expected_s = math.sqrt(2.0 * height_m / rig.gravity_m_per_s2)
        start_s = expected_s - self.TOUCH_AT / self.RATE_HZ
        volts = np.zeros(samples)
        stop_s = start_s + samples / self.RATE_HZ
        for piece in render_flight(rig, flight, start_s, self.RATE_HZ, until_s=stop_s):
            a, b = max(piece.first, 0), min(piece.first + piece.volts.size, samples)
            volts[a:b] += piece.volts[a - piece.first : b - piece.first]
        for effect in rig.effects:
            hum = effect.ambient(start_s + np.arange(samples) / self.RATE_HZ)
            volts += 0.0 if hum is None else hum
        return volts, flight.touches[0]

    def with_effect(
        self,
        effect_id: str,
        values: Mapping[str, float],
        scope: Scope | None = None,
        cell: str = "kv",
    ) -> DrawnRig:
        """Return a rig with one effect."""
        return self.a_rig(make_effect(effect_id, values, scope), cell=cell)

    def with_form(self, effect_id: str, values: Mapping[str, float], form: str) -> DrawnRig:
        """Return a rig with one effect in one of its forms."""
        return self.a_rig(make_effect(effect_id, values, form=form))

    def bodies(self, rig: DrawnRig, surface: str) -> Mechanics:
        """Return what an acetal sphere meets."""
        rng = np.random.default_rng(0)
        return rig.mechanics(Shot(1, "acetal", surface, 0.03, rng), 0.77, rng)

    def loss(self, rig: DrawnRig, height_m: float) -> float:
        """Return 1 - rebound/impact."""
        touch = self.drop(rig, height_m)[1]
        return 1.0 - touch.rebound_speed_m_per_s / touch.speed_m_per_s

    def ring_frequency(self, rig: DrawnRig, surface: str) -> float:
        """Return the ring's frequency from its zero crossings. [Hz]"""
        volts, touch = self.drop(rig, surface=surface)
        ring = volts[self.BEFORE + round(touch.contact_time_s * self.RATE_HZ) + 40 :][:350]
        at = np.flatnonzero(np.signbit(ring[1:]) != np.signbit(ring[:-1]))
        exact = at + ring[at] / (ring[at] - ring[at + 1])
        return float(self.RATE_HZ * (len(exact) - 1) / 2.0 / (exact[-1] - exact[0]))


@pytest.fixture
def lab() -> Lab:
    """Return the laboratory."""
    return Lab()
