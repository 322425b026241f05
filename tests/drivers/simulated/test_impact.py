"""The simulator's integrator against analytic results and an independent integration."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import gamma

from drivers.simulated import impact_kernel as kernel
from drivers.simulated.impact import ContactTerm, IntegrationError, Mechanics, simulate_impact

G = 9.80665
SPEED = math.sqrt(2.0 * G * 0.047)


def figure_2(restitution: float, **changes: float | bool) -> Mechanics:
    """Return the bodies of the paper's Fig. 2."""
    e_star = 3e9 / (1.0 - 0.33**2) / 2.0
    bodies = Mechanics(0.407e-3, 4.76e-3, e_star, restitution, G, 0.1, 1e9, 3e3)
    return replace(bodies, **changes)  # type: ignore[arg-type]  # a mixed bag of fields


def test_contact_time_and_peak_force_are_those_of_hertz_on_a_rigid_cell() -> None:
    """On a rigid cell without loss and gravity, the impact is Hertz's own."""
    bodies = figure_2(1.0, rigid=True, gravity_m_per_s2=0.0)
    impact = simulate_impact(bodies, SPEED)
    m, K = bodies.sphere_mass_kg, bodies.contact_stiffness
    deepest = (1.25 * m * SPEED**2 / K) ** 0.4
    # t_c = 2 deepest/v integral_0^1 dx / sqrt(1 - x^(5/2)) = 2.9432... deepest/v.
    integral = 2.0 * math.sqrt(math.pi) * gamma(0.4) / (5.0 * gamma(0.9)) * 2.0
    assert integral == pytest.approx(2.9432, abs=1e-4)
    assert impact.contact_time_s == pytest.approx(integral * deepest / SPEED, rel=1e-9)
    assert impact.peak_force_n == pytest.approx(K * deepest**1.5, rel=1e-9)
    assert impact.rebound_speed_m_per_s == pytest.approx(SPEED, rel=1e-8)


@pytest.mark.parametrize("restitution", [0.95, 0.8, 0.5])
def test_rebound_on_a_rigid_cell_is_the_restitution_of_equation_6(restitution: float) -> None:
    """Without gravity the dashpot of Eqs 3 and 5 returns exactly eps of the impact speed."""
    bodies = figure_2(restitution, rigid=True, gravity_m_per_s2=0.0)
    impact = simulate_impact(bodies, SPEED)
    assert impact.rebound_speed_m_per_s / SPEED == pytest.approx(restitution, rel=1e-7)


def test_energy_lost_by_a_lossless_sphere_is_found_in_the_crystal() -> None:
    """With eps = 1 and an undamped crystal, the ring holds what the sphere misses."""
    bodies = figure_2(1.0, gravity_m_per_s2=0.0, cell_damping_n_s_per_m=0.0)
    impact = simulate_impact(bodies, SPEED, step_s=1e-8, points=60_000)
    m, k = bodies.sphere_mass_kg, bodies.cell_stiffness_n_per_m
    ring = np.max(np.abs(impact.compression_m[int(impact.contact_time_s / 1e-8) + 10 :]))
    missing = 0.5 * m * (SPEED**2 - impact.rebound_speed_m_per_s**2)
    assert 0.5 * k * ring**2 == pytest.approx(missing, rel=2e-6)


@pytest.mark.parametrize(("restitution", "force_n"), [(1.0, 18.98), (0.7, 15.57)])
def test_figure_2_of_the_paper_is_reproduced(restitution: float, force_n: float) -> None:
    """Peak force 16-19 N, indentation nearly three orders above the crystal's compression."""
    impact = simulate_impact(figure_2(restitution), SPEED, step_s=1e-7, points=3000)
    assert impact.peak_force_n == pytest.approx(force_n, abs=0.01)
    assert 930.0 < impact.peak_indentation_m / impact.peak_compression_m < 1000.0
    if restitution == 1.0:
        force_peak_s = 0.5 * impact.contact_time_s
        assert np.argmax(impact.compression_m) * 1e-7 - force_peak_s == pytest.approx(
            11e-6, abs=1e-6
        )


def test_rebound_of_the_coupled_system_is_a_little_below_equation_6() -> None:
    """The crystal keeps some of the energy; the value is that of an independent integration."""
    impact = simulate_impact(figure_2(0.8), SPEED)
    assert impact.rebound_speed_m_per_s / SPEED == pytest.approx(0.79949940, abs=1e-7)


def test_trace_agrees_with_an_independent_integration() -> None:
    """The whole trace, ring included, agrees with scipy's DOP853 at rtol 1e-12 to 1e-8."""
    bodies = Mechanics(6.116e-4, 4.76e-3, 1.5e9, 0.8, G, 35.4e-3, 4.16e8, 560.0)
    m, M, k, mu = 6.116e-4, 35.4e-3, 4.16e8, 560.0
    K, loss = bodies.contact_stiffness, bodies.loss_coefficient

    def motion(_t: float, s: np.ndarray, touching: bool) -> list[float]:
        x, v, u, w = s
        d, elastic, lost = max(x - u, 0.0), 0.0, 0.0
        if touching:
            elastic = K * d**1.5
            lost = loss * math.sqrt(m * K) * d**0.25 * (v - w)
        return [v, G - (elastic + lost) / m, w, (elastic - k * u - mu * w) / M]

    def apart(_t: float, s: np.ndarray, _touching: bool) -> float:
        return float(s[0] - s[2])

    apart.terminal, apart.direction = True, -1  # type: ignore[attr-defined]  # scipy's way
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-19, "dense_output": True}
    first = solve_ivp(motion, (0, 1e-3), [0, 0.9, 0, 0], args=(True,), events=apart, **options)
    end_s = float(first.t[-1])
    second = solve_ivp(motion, (end_s, 1e-3), first.y[:, -1], args=(False,), **options)
    t = np.arange(1000) * 1e-6
    expected = np.where(t <= end_s, first.sol(t)[2], second.sol(t)[2])
    impact = simulate_impact(bodies, 0.9, points=1000)
    peak = np.max(np.abs(expected))
    assert np.max(np.abs(impact.compression_m - expected)) < 1e-8 * peak
    assert impact.contact_time_s == pytest.approx(end_s, rel=1e-9)


def test_grid_may_begin_before_touch_down() -> None:
    """Samples before touch-down are zero and the rest are shifted, not changed."""
    bodies = figure_2(0.8)
    whole = simulate_impact(bodies, SPEED, points=500)
    early = simulate_impact(bodies, SPEED, first_s=-5e-6, points=505)
    assert np.all(early.compression_m[:5] == 0.0)
    np.testing.assert_allclose(early.compression_m[5:], whole.compression_m, atol=1e-17)


def test_a_tighter_tolerance_changes_nothing_that_matters() -> None:
    """The default tolerance is converged far below the noise."""
    a = simulate_impact(figure_2(0.8), SPEED)
    b = simulate_impact(figure_2(0.8), SPEED, tolerance=1e-12)
    peak = b.peak_compression_m
    assert np.max(np.abs(a.compression_m - b.compression_m)) < 1e-8 * peak


def test_an_impact_without_speed_is_refused() -> None:
    """A sphere that does not move does not hit."""
    with pytest.raises(ValueError, match="speed above zero"):
        simulate_impact(figure_2(0.8), 0.0)


def test_more_contact_effects_than_the_kernel_follows_are_refused() -> None:
    """The limit is named."""
    term = ContactTerm(kernel.HUNT_CROSSLEY, (0.1,))
    bodies = replace(figure_2(0.8), terms=[term] * 7)
    with pytest.raises(ValueError, match="at most 6"):
        simulate_impact(bodies, SPEED)


def test_an_effect_far_outside_its_size_is_an_error_and_no_hang() -> None:
    """A tape as stiff as nothing on earth ends with words."""
    bodies = figure_2(
        0.8, coupon_mass_kg=1e-9, layer_stiffness_n_per_m=1e14, layer_damping_n_s_per_m=0.0
    )
    with pytest.raises(IntegrationError, match="outside its usual size"):
        simulate_impact(bodies, SPEED)


@pytest.mark.parametrize("restitution", [0.8, 1.0])
def test_a_relaxing_body_does_not_pull_the_crystal_of_the_papers_rig(restitution: float) -> None:
    """Where the indentation would end it, relaxation ends the contact once its force is zero."""
    bodies = figure_2(restitution, rigid=True)
    relaxing = replace(bodies, terms=[ContactTerm(kernel.RELAXATION, (0.15, 20e-6))])
    found = simulate_impact(relaxing, 0.96, step_s=1e-7, points=1500)
    assert found.elastic_force_n.min() >= -1e-9 * found.elastic_force_n.max()
    assert found.contact_time_s < simulate_impact(bodies, 0.96, points=1).contact_time_s
    idle = replace(bodies, terms=[ContactTerm(kernel.RELAXATION, (0.0, 20e-6))])
    plain = simulate_impact(bodies, 0.96, step_s=1e-7, points=1500)
    same = simulate_impact(idle, 0.96, step_s=1e-7, points=1500)
    assert same.contact_time_s == pytest.approx(plain.contact_time_s, rel=1e-9)
