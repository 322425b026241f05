"""The closed base without some laws of mechanics: against the simulator, and between kv and kv2."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from analysis.aliases import Array
from analysis.errors import UnknownModelError
from analysis.model.hertz import closed_damping_coefficient, damping_coefficient
from analysis.model.impact_model import (
    COUPON,
    FORCE_END,
    LAWS,
    MIXED,
    REACTION,
    ImpactModel,
    ShotFrame,
    model_named,
)
from drivers.simulated import impact_kernel as kernel
from drivers.simulated.impact import Mechanics, simulate_impact
from drivers.simulated.specimens import SPHERES

M, K_CELL, MU, COUPON_KG = 35.4e-3, 4.16e8, 560.0, 6e-3
SAMPLES, TOUCH_S, SPEED, RESTITUTION = 2000, 200.37e-6, 0.955, 0.8
SPHERE = SPHERES["acetal"]
SOFTNESS = (1 - SPHERE.poissons_ratio**2) / SPHERE.youngs_modulus_pa + (1 - 0.35**2) / 3e9


def _simulated(model: ImpactModel) -> Array:
    """Return the crystal's compression that the simulator has of such a rig. [m]"""
    bodies = Mechanics(
        SPHERE.mass_kg, SPHERE.radius_m, 1 / SOFTNESS, RESTITUTION, 9.80665, M, K_CELL, MU,
        third_law=model.obeys(REACTION),
        coupon_rides=model.obeys(COUPON),
        lift_off_rule=kernel.AT_FORCE if model.obeys(FORCE_END) else kernel.AT_INDENTATION,
        coupon_label_mass_kg=COUPON_KG,
    )  # fmt: skip
    return simulate_impact(bodies, SPEED, first_s=-TOUCH_S, points=SAMPLES).compression_m


def _own_restitution(model: ImpactModel) -> float:
    """Return the model's own restitution for the dashpot of Eq. 6's, which the simulator has."""
    if not model.obeys(FORCE_END):
        return RESTITUTION
    alpha = damping_coefficient(RESTITUTION)
    return brentq(lambda e: closed_damping_coefficient(e) - alpha, 0.3, 0.999, xtol=1e-14)


def _predicted(model: ImpactModel) -> Array:
    stiffness = 4 / 3 * math.sqrt(SPHERE.radius_m) / SOFTNESS
    omega = math.sqrt(K_CELL / M)
    own = {
        "ln_K": math.log(stiffness),
        "ln_S": math.log(K_CELL),
        "ln_w": math.log(omega),
        "ln_z": math.log(MU / (2 * M * omega)),
        "ln_M": math.log(M),
        "ln_v0": math.log(SPEED),
        "ln_e": math.log(_own_restitution(model)),
        "t0_us": TOUCH_S * 1e6,
    }
    frame = ShotFrame(
        1e6, SAMPLES, SPHERE.mass_kg, 9.80665, radius_m=SPHERE.radius_m, coupon_mass_kg=COUPON_KG,
        coupon_on_crystal_kg=COUPON_KG if model.obeys(COUPON) else 0.0,
    )  # fmt: skip
    return model.predict(np.array([own.get(n, 0.0) for n in model.names]), frame).signal


@pytest.mark.parametrize("name", ["kv", "kv2", *(mixed.base_name for mixed in MIXED)])
def test_a_base_is_what_the_simulator_integrates(name: str) -> None:
    """To a millionth of the peak or two."""
    wanted = _simulated(model_named(name))
    found = _predicted(model_named(name))
    assert np.abs(found - wanted).max() < 2e-6 * wanted.max()


def test_the_mixed_ones_are_all_that_lie_between() -> None:
    """One law or two left out of three, each under a name that is read back."""
    assert len(MIXED) == 2 ** len(LAWS) - 2
    for mixed in MIXED:
        name = f"{mixed.base_name}+echo"
        assert model_named(name).name == name


def test_the_solver_with_effects_has_the_same_closed_base() -> None:
    """All three left out is kv, no law at all left out is kv2, by the other solver."""
    closed = model_named("kv2")
    other = replace(closed, left_out=("none",))
    assert np.allclose(_predicted(other), _predicted(closed), rtol=0, atol=1e-12)
    none = replace(closed, left_out=LAWS)
    assert np.allclose(_predicted(none), _predicted(model_named("kv")), rtol=0, atol=1e-12)


def test_a_law_that_nobody_knows_is_refused() -> None:
    """With those there are."""
    with pytest.raises(UnknownModelError, match="kv2-reaction"):
        model_named("kv2-gravity")
