"""Whether the sphere touches again: against the simulator, which would follow it if it did."""

from __future__ import annotations

import math

import numpy as np
import pytest

from analysis.model.impact_model import ShotFrame, model_named
from drivers.simulated.impact import Mechanics, simulate_impact
from drivers.simulated.specimens import SPHERES, SphereSpec

M, K_CELL, MU = 35.4e-3, 4.16e8, 560.0
SAMPLES, TOUCH_S = 2900, 200.37e-6
MODEL = model_named("kv+adhesive_layer")


def apart(sphere: SphereSpec, modulus: float, coupon: float, tape: float) -> float:
    """Return the largest difference of the two traces over the peak."""
    speed, eps, damping = 0.955, 0.7, 0.06 * math.sqrt(tape * coupon)
    softness = (1 - sphere.poissons_ratio**2) / sphere.youngs_modulus_pa + (1 - 0.35**2) / modulus
    bodies = Mechanics(
        sphere.mass_kg, sphere.radius_m, 1 / softness, eps, 9.80665, M, K_CELL, MU,
        coupon_mass_kg=coupon, layer_stiffness_n_per_m=tape, layer_damping_n_s_per_m=damping,
    )  # fmt: skip
    omega = math.sqrt(K_CELL / M)
    own = {
        "ln_K": math.log(bodies.contact_stiffness),
        "ln_S": math.log(K_CELL),
        "ln_w": math.log(omega),
        "ln_z": math.log(MU / (2 * M * omega)),
        "ln_M": math.log(M),
        "ln_v0": math.log(speed),
        "ln_e": math.log(eps),
        "t0_us": TOUCH_S * 1e6,
        "adhesive_layer.stiffness_n_per_m": math.log(tape),
        "adhesive_layer.damping_n_s_per_m": math.log(damping),
    }
    frame = ShotFrame(
        1e6, SAMPLES, sphere.mass_kg, 9.80665, radius_m=sphere.radius_m, coupon_mass_kg=coupon
    )
    found = MODEL.predict(np.array([own.get(n, 0.0) for n in MODEL.names]), frame).signal
    wanted = simulate_impact(bodies, speed, first_s=-TOUCH_S, points=SAMPLES).compression_m
    return float(np.abs(found - wanted).max() / wanted.max())


@pytest.mark.parametrize("sphere", ["acetal_small", "acetal", "steel"])
@pytest.mark.parametrize("modulus", [2.2e9, 69e9])
@pytest.mark.parametrize("tape", [1e7, 4.6e7, 1e8])
def test_a_coupon_on_tape_never_catches_the_sphere_up(
    sphere: str, modulus: float, tape: float
) -> None:
    """From (2 + e) / e of the sphere's mass on, the simulator follows no further contact."""
    spec = SPHERES[sphere]
    for times in (2.7 / 0.7, 8.0, 20.0):
        assert apart(spec, modulus, times * spec.mass_kg, tape) < 1e-6


def test_a_coupon_lighter_than_that_on_soft_tape_does() -> None:
    """The border: steel on a hard coupon of 1.2 g on 1e7 N/m leaves before the tape answers."""
    assert apart(SPHERES["steel"], 69e9, 1.2e-3, 1e7) > 0.1
