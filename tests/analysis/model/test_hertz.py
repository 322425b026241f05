"""Hertz's closed forms against limits, energy and the independent integration."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from analysis.errors import ParameterOutOfRangeError
from analysis.model import hertz


def test_rigid_partner_leaves_the_other_modulus() -> None:
    """A contact with a rigid body has the soft body's plane-strain modulus."""
    soft = hertz.plane_strain_modulus(2.2e9, 0.37)
    assert hertz.reduced_modulus(soft, 1e30) == pytest.approx(soft, rel=1e-12)


def test_equal_partners_share_the_compliance() -> None:
    """Two equal bodies have half their plane-strain modulus."""
    assert hertz.reduced_modulus(4e9, 4e9) == pytest.approx(2e9)


def test_incompressible_material_is_stiffer_in_plane_strain_by_a_third() -> None:
    """At nu = 1/2 the plane-strain modulus is 4/3 of Young's."""
    assert hertz.plane_strain_modulus(3e9, 0.5) == pytest.approx(4e9)


def test_contact_stiffness_has_hertz_form() -> None:
    """K is 4/3 sqrt(R) E*."""
    assert hertz.contact_stiffness(1.5e9, 4e-4) == pytest.approx(4 / 3 * 0.02 * 1.5e9)


def test_contact_time_factor_is_the_integral() -> None:
    """The factor of the contact time is twice the integral of 1/sqrt(1 - x^2.5)."""
    # x = 1 - s^2 takes the singularity at the end away
    value, _ = quad(lambda s: 2 * s / math.sqrt(1 - (1 - s * s) ** 2.5), 0, 1)
    assert pytest.approx(2 * value, rel=1e-6) == hertz.CONTACT_TIME_FACTOR


def test_loss_free_contact_time_and_force_match_the_integration(impact: Any) -> None:
    """Closed forms of contact time and peak force agree with an integrated loss-free contact."""
    K, m, v = 2e8, 6e-4, 0.9
    times = np.linspace(0, 1.2e-4, 24001)
    force, _, duration, rebound = impact(K, m, v, 1.0, gravity=0.0).solve(times)
    assert hertz.contact_time(K, m, v) == pytest.approx(duration, rel=1e-6)
    assert hertz.peak_force(K, m, v) == pytest.approx(force.max(), rel=1e-6)
    assert rebound == pytest.approx(v, rel=1e-9)


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8, 0.95])
def test_damping_coefficient_gives_back_the_restitution(impact: Any, restitution: float) -> None:
    """A rigid-cell contact with Eq. 5's dashpot rebounds at eps times its speed."""
    _, _, _, rebound = impact(2e8, 6e-4, 0.9, restitution, gravity=0.0).solve(np.zeros(1))
    assert rebound / 0.9 == pytest.approx(restitution, rel=1e-8)
    # the coefficient itself, not only the test's own copy of Eq. 5
    log = math.log(restitution)
    assert hertz.damping_coefficient(restitution) == pytest.approx(
        -math.sqrt(5) * log / math.sqrt(log**2 + math.pi**2)
    )


def test_no_loss_needs_no_dashpot() -> None:
    """At eps = 1 the dashpot vanishes."""
    assert hertz.damping_coefficient(1.0) == 0.0


@pytest.mark.parametrize(
    ("call", "name", "value"),
    [
        (lambda: hertz.plane_strain_modulus(-1.0, 0.3), "youngs_modulus_pa", -1.0),
        (lambda: hertz.plane_strain_modulus(1e9, 0.51), "poissons_ratio", 0.51),
        (lambda: hertz.contact_stiffness(1e9, 0.0), "radius_m", 0.0),
        (lambda: hertz.damping_coefficient(0.0), "restitution", 0.0),
    ],
)
def test_impossible_quantities_are_refused_by_name(call: Any, name: str, value: float) -> None:
    """A quantity no rig can have is refused, and the error carries name and value."""
    with pytest.raises(ParameterOutOfRangeError) as caught:
        call()
    assert caught.value.name == name
    assert caught.value.value == value
    assert name in str(caught.value)
