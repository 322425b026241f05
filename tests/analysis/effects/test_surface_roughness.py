"""A sphere on a rough surface: against the model solved anew, and other people's numbers."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from analysis.effects.surface_roughness import bulk_depth

from .conftest import Rig, apart
from .reference import Law
from .rough_by_pressures import AREAS, CENTRES, contact

RIG = Rig()


def overlap(y: float, b: float, *, begins: float = 1.0) -> float:
    """Return the whole indentation for the bulk's, both over sigma; without a beginning, Eq. 5."""
    return y + math.log(begins + b * y**1.5 / (1 + math.e / 3 * y))


def rough(sigma: float) -> Law:
    """Return the law with the bulk's indentation found by bracketing."""

    def law(d: float, r: float, z: Any) -> tuple[float, float, tuple[()]]:
        if d <= 0.0:
            return 0.0, 0.0, ()
        b, depth = 200 / (3 * math.pi), d / sigma
        y = brentq(lambda x: overlap(x, b) - depth, 0.0, depth, xtol=1e-18, rtol=1e-15)
        late, first = 1 + math.e / 3 * y, b * y**1.5
        softer = 1 + b * math.sqrt(y) * (1.5 + math.e / 6 * y) / (late * (late + first))
        return RIG.stiffness * (sigma * y) ** 1.5, RIG.dashpot(sigma * y, r / softer), ()

    return law


@pytest.mark.parametrize("sigma", [1e-7, 1e-6])
def test_an_impact_on_a_rough_coupon_is_that_of_dop853(sigma: float) -> None:
    """The law, integrated in time."""
    found = RIG.predict("kv+surface_roughness", {"surface_roughness.roughness_m": sigma})
    wanted = RIG.reference(law=rough(sigma))
    assert apart(found.signal, wanted.compression) < 2e-6
    assert found.contact_time_s == pytest.approx(wanted.contact_time, rel=1e-6)


@pytest.mark.parametrize("hardness", [3.0, 30.0])
def test_the_closed_form_is_the_solution_of_greenwood_and_tripp(hardness: float) -> None:
    """From asperities that carry all to a bulk that does: within 0.015 of their height."""
    b = 2 * hardness / (3 * math.pi)
    for depth in (-4.0, -1.0, 0.0, 1.0, 2.0, 4.0, 7.0, 12.0, 25.0, 50.0):
        force, _ = contact(depth, hardness)
        assert overlap((0.75 * force) ** (2 / 3), b, begins=0.0) == pytest.approx(depth, abs=0.015)


def test_light_loads_are_exponential_and_heavy_ones_hertz() -> None:
    """F = 2 pi R sigma p_c exp(depth / sigma), and Hertz's centre pressure."""
    force, _ = contact(-5.0, 3.0)
    assert force == pytest.approx(2 * math.pi / 3.0 * math.exp(-5.0), rel=0.02)
    force, pressure = contact(60.0, 3.0)
    hertz = 2 / math.pi * math.sqrt((0.75 * force) ** (2 / 3))
    assert pressure[0] == pytest.approx(hertz, rel=0.03)


@pytest.mark.parametrize("hardness", [0.5, 3.0])
def test_hertz_is_seven_per_cent_off_at_a_twentieth(hardness: float) -> None:
    """Greenwood, Johnson & Matsubara 1984: about 7 % at alpha = sigma R / a^2 = 0.05."""

    def alpha(depth: float) -> float:
        return (0.75 * contact(depth, hardness)[0]) ** (-2 / 3)

    depth = brentq(lambda d: alpha(d) - 0.05, 5.0, 40.0, rtol=1e-4)
    force, pressure = contact(depth, hardness)
    a = (0.75 * force) ** (1 / 3)
    assert pressure[0] / (2 / math.pi * a) == pytest.approx(0.93, abs=0.01)
    mean_radius = float((pressure * CENTRES) @ AREAS) / force
    assert mean_radius / (3 * math.pi / 16 * a) == pytest.approx(1.07, abs=0.01)


def test_where_the_contact_begins_is_a_shift_of_touch_down() -> None:
    """A tenth of the first asperities' pressure moves the force by a depth, to 3 % of sigma."""
    y = np.linspace(5.0, 100.0, 50)
    usual = np.array([overlap(v, 200 / (3 * math.pi)) for v in y])
    other = np.array([overlap(v, 2000 / (3 * math.pi)) for v in y])
    assert np.ptp(other - usual) < 0.03


def test_a_smooth_surface_is_hertz() -> None:
    """The bulk takes all but a logarithm."""
    assert bulk_depth(1e9) == pytest.approx((1e9, 1.0), rel=3e-8)
    assert bulk_depth(1e-12) == pytest.approx((1e-12, 1.0), rel=1e-4)
    depths = np.linspace(0.2, 40.0, 4000)
    found = np.array([bulk_depth(float(d)) for d in depths])
    assert found[:, 1] == pytest.approx(np.gradient(found[:, 0], depths, edge_order=2), abs=1e-3)
    assert np.all(found[:, 1] > 0)


def soft_toe(s: float) -> Law:
    """Return Hertz times what of the asperities is flat."""

    def law(d: float, r: float, z: Any) -> tuple[float, float, tuple[()]]:
        if d <= 0.0:
            return 0.0, 0.0, ()
        return RIG.stiffness * d**1.5 * -math.expm1(-d / s), RIG.dashpot(d, r), ()

    return law


@pytest.mark.parametrize("s", [1e-7, 1e-6])
def test_an_impact_on_asperities_that_flatten_is_that_of_dop853(s: float) -> None:
    """The form with a soft toe, integrated in time."""
    found = RIG.predict("kv+surface_roughness:toe", {"surface_roughness:toe.roughness_m": s})
    wanted = RIG.reference(law=soft_toe(s))
    assert apart(found.signal, wanted.compression) < 2e-6
    assert found.contact_time_s == pytest.approx(wanted.contact_time, rel=1e-6)


def layer(s: float, force_n: float) -> Law:
    """Return the law of a layer in series, its force found by bracketing."""

    def law(d: float, r: float, z: Any) -> tuple[float, float, tuple[()]]:
        if d <= 0.0:
            return 0.0, 0.0, ()
        K = RIG.stiffness
        force = brentq(
            lambda f: (f / K) ** (2 / 3) + s * math.log1p(f / force_n) - d,
            0.0,
            K * d**1.5,
            xtol=1e-16,
            rtol=1e-15,
        )
        return force, RIG.dashpot(d, r), ()

    return law


@pytest.mark.parametrize(("s", "force_n"), [(2e-7, 0.1), (1e-6, 1.0)])
def test_an_impact_on_a_layer_of_asperities_is_that_of_dop853(s: float, force_n: float) -> None:
    """The form whose area does not grow, integrated in time."""
    effect = "surface_roughness:layer"
    values = {f"{effect}.roughness_m": s, f"{effect}.layer_force_n": force_n}
    found = RIG.predict(f"kv+{effect}", values)
    wanted = RIG.reference(law=layer(s, force_n))
    assert apart(found.signal, wanted.compression) < 2e-6
    assert found.contact_time_s == pytest.approx(wanted.contact_time, rel=1e-6)
