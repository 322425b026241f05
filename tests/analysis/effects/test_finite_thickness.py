"""A sphere on a thin bonded coupon: against the layer solved anew, and other people's numbers."""

from __future__ import annotations

import numpy as np
import pytest

from analysis.effects.finite_thickness import series, stiffer

from .conftest import Rig, apart
from .layer_by_pressures import compliance_less_one, contact
from .thin_coupon import thin_coupon

RIG = Rig()
GARCIA_2018 = [0.755, 1.469, 1.497, 1.133, 1.0]
"""P. D. Garcia & R. Garcia, Biophys. J. 114 (2018) 2923, bonded, nu = 0.5, rigid sphere."""


@pytest.mark.parametrize(("share", "nu"), [(0.5, 0.33), (0.9, 0.45), (1.0, 0.5)])
def test_an_impact_on_a_thin_coupon_is_that_of_dop853(share: float, nu: float) -> None:
    """The law at one radius of contact, integrated in time."""
    rig = RIG.but(coupon_share=share, poissons_ratio=nu)
    found = rig.predict("kv+finite_thickness", {"finite_thickness.thickness_m": 2e-3})
    wanted = rig.reference(law=thin_coupon(rig, 2e-3))
    assert apart(found.signal, wanted.compression) < 2e-6
    assert found.contact_time_s == pytest.approx(wanted.contact_time, rel=1e-6)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.37, 0.45, 0.5])
@pytest.mark.parametrize("share", [0.1, 0.4, 0.7, 1.0])
def test_the_law_is_the_solution_of_the_bonded_layer(nu: float, share: float) -> None:
    """Within 0.06 % up to X = 0.5, 0.2 % up to X = 1, for any sphere and Poisson's ratio."""
    for a_over_h in (0.05, 0.15, 0.3, 0.45, 0.6, 0.8, 1.0, 1.2, 1.4):
        X, wanted = contact(a_over_h, nu, share)
        if X <= 1.0:
            assert stiffer(X, share, nu) == pytest.approx(wanted, rel=6e-4 if X < 0.5 else 2e-3)


def test_a_rigid_sphere_on_rubber_is_garcias() -> None:
    """Published coefficients for nu = 0.5: within 0.8 % up to X = 0.45; the slope within 0.6 %."""
    for X in (0.05, 0.1, 0.2, 0.3, 0.45):
        assert stiffer(X, 1.0, 0.5) == pytest.approx(np.polyval(GARCIA_2018, X), rel=8e-3)
    assert (stiffer(1e-4, 1.0, 0.5) - 1.0) / 1e-4 == pytest.approx(1.133, rel=6e-3)
    assert (stiffer(1e-4, 1.0, 0.37) - 1.0) / 1e-4 == pytest.approx(0.938, rel=6e-3)


def test_the_second_coefficient_is_seven_sixths_of_the_first_squared() -> None:
    """As Garcia's 1.497 = 7/6 1.133^2; the series of 2002 has 1.283 = 1.133^2, and is low by it."""
    c = (stiffer(1e-5, 1.0, 0.5) - stiffer(-1e-5, 1.0, 0.5)) / 2e-5
    X = 0.02
    bend = (stiffer(X, 1.0, 0.5) + stiffer(-X, 1.0, 0.5) - 2.0) / (2.0 * X**2)
    assert bend == pytest.approx(7 / 6 * c**2, rel=2e-3)
    series_2002 = np.polyval([-0.0975, 0.769, 1.283, 1.133, 1.0], 0.49)
    assert series_2002 / stiffer(0.49, 1.0, 0.5) - 1.0 == pytest.approx(-0.08, abs=5e-3)


def test_the_reference_solution_has_its_limits() -> None:
    """A thick layer is a half-space; long waves press it as a column held at its sides."""
    X, whole = contact(1e-4, 0.37, 1.0)
    assert pytest.approx(1e-4, rel=1e-3) == X
    assert whole == pytest.approx(1.0, abs=2e-4)
    long = compliance_less_one(np.array([1e-4]), 0.3)[0] + 1.0
    assert long == pytest.approx(1e-4 * (1 - 0.6) / (2 * 0.7**2), rel=1e-3)


def test_only_the_coupon_is_stiffened() -> None:
    """Of a coupon with a hundredth of the compliance the thickness is seen at a hundredth."""
    alone = stiffer(0.3, 1.0, 0.37) - 1.0
    assert stiffer(0.3, 0.01, 0.37) - 1.0 < 0.01 * alone
    assert stiffer(0.3, 0.0, 0.37) == pytest.approx(1.0, abs=1e-15)
    # what it cannot exceed is the sphere on rigid ground
    assert stiffer(50.0, 0.4, 0.3) < 1.0 / 0.6


def test_the_force_rises_with_depth_wherever_a_fit_may_look() -> None:
    """Up to ten times the radius of contact over the thickness, and without a jump."""
    for nu in (0.0, 0.3, 0.45, 0.5):
        for share in (0.05, 0.5, 1.0):
            x = np.linspace(0.01, 7.0, 400)
            force = np.array([stiffer(float(v), share, nu) * v**3 for v in x])
            assert np.all(np.diff(force) > 0)
            assert np.all(np.diff(force, 2) > -1e-3 * force[1:-1])


def test_the_series_of_dimitriadis_has_its_coefficients() -> None:
    """1.133, 1.283, 0.769 and -0.0974 at nu = 0.5, and 0.938 for the first at nu = 0.37."""
    for X in (0.05, 0.3, 0.8):
        wanted = np.polyval([-0.0974, 0.769, 1.283, 1.133, 1.0], X)
        assert series(X, 0.5, False) == pytest.approx(wanted, rel=1e-3)
    assert (series(1e-6, 0.37, False) - 1.0) / 1e-6 == pytest.approx(0.938, abs=1e-3)


@pytest.mark.parametrize("form", ["dimitriadis", "whole_contact"])
def test_an_impact_by_a_series_is_that_of_dop853(form: str) -> None:
    """The coupon's part, or the whole contact, stiffened by the series, integrated in time."""
    rig = RIG.but(coupon_share=0.6, poissons_ratio=0.4)
    share, nu, quoted = (0.6, 0.4, False) if form == "dimitriadis" else (1.0, 0.5, True)
    slope = np.sqrt(rig.radius) / 3e-3

    def law(d: float, r: float, z: object) -> tuple[float, float, tuple[()]]:
        if d <= 0.0:
            return 0.0, 0.0, ()
        factor = 1.0 / (1.0 - share + share / series(slope * np.sqrt(d), nu, quoted))
        return rig.stiffness * d**1.5 * factor, rig.dashpot(d, r), ()

    name = f"finite_thickness:{form}"
    found = rig.predict(f"kv+{name}", {f"{name}.thickness_m": 3e-3})
    wanted = rig.reference(law=law)
    assert apart(found.signal, wanted.compression) < 2e-6
