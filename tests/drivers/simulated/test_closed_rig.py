"""The closed rig against an integration written here, energy balances and published numbers."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import beta

from drivers.simulated import impact_kernel as kernel
from drivers.simulated.impact import ContactTerm, Mechanics, simulate_impact
from drivers.simulated.loss_laws import hunt_crossley_constant, kuwabara_kono_constant

G = 9.80665
SPEED = 0.9
COUPON_KG = 3.6e-3


def closed(**changes: object) -> Mechanics:
    """Return an acetal sphere over a polycarbonate coupon on the paper's cell, all laws kept."""
    bodies = Mechanics(
        6.116e-4, 4.76e-3, 1.5e9, 0.8, G, 35.4e-3, 4.16e8, 560.0,
        third_law=True, coupon_rides=True, lift_off_rule=kernel.AT_FORCE,
        coupon_label_mass_kg=COUPON_KG,
    )  # fmt: skip
    return replace(bodies, **changes)  # type: ignore[arg-type]  # a mixed bag of fields


def independent(bodies: Mechanics, relaxing: tuple[float, float] = (0.0, 1e-5)):  # type: ignore[no-untyped-def]
    """Integrate the closed equations with scipy, contact and ring apart, event where F is zero.

    Returns the compression over time, the time of lift-off, the force there and the peak force,
    and the energy that the dashpots took.
    """
    m, M = bodies.sphere_mass_kg, bodies.cell_mass_kg + COUPON_KG
    k, mu = bodies.cell_stiffness_n_per_m, bodies.cell_damping_n_s_per_m
    K, a, (g, tau) = bodies.contact_stiffness, bodies.loss_coefficient, relaxing
    power, weight = {
        kernel.TSUJI: (0.25, a * math.sqrt(m * K)),
        kernel.KUWABARA_KONO_LOSS: (0.5, 1.5 * a * K),
        kernel.HUNT_CROSSLEY_LOSS: (1.5, a * K),
    }[bodies.loss_law]

    def contact(s: np.ndarray) -> tuple[float, float]:
        d = max(s[0] - s[2], 0.0)
        rate = s[1] - s[3]
        held = K * d**1.5 + g * K * (d**1.5 - s[4])
        return held, weight * d**power * rate

    def motion(_t: float, s: np.ndarray, touching: bool) -> list[float]:
        held, lost = contact(s) if touching else (0.0, 0.0)
        follows = max(s[0] - s[2], 0.0) ** 1.5 if touching else g / (1 + g) * s[4]
        return [
            s[1],
            bodies.gravity_m_per_s2 - (held + lost) / m,
            s[3],
            (held + lost - k * s[2] - mu * s[3]) / M,
            (follows - s[4]) / tau,
            (lost * (s[1] - s[3]) if touching else 0.0) + mu * s[3] ** 2,
        ]

    def no_force(t: float, s: np.ndarray, _touching: bool) -> float:
        apart = s[0] - s[2]
        return 1.0 if t < 1e-6 else sum(contact(s)) if apart > 0.0 else apart

    no_force.terminal, no_force.direction = True, -1  # type: ignore[attr-defined]  # scipy's way
    options = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-19, "dense_output": True}
    start = [0.0, SPEED, 0.0, 0.0, 0.0, 0.0]
    first = solve_ivp(motion, (0, 1e-3), start, args=(True,), events=no_force, **options)
    end_s = float(first.t[-1])
    last = first.y[:, -1]
    second = solve_ivp(motion, (end_s, 1.2e-3), last, args=(False,), **options)
    t = np.arange(1000) * 1e-6
    trace = np.where(t <= end_s, first.sol(t)[2], second.sol(t)[2])
    fine = first.sol(np.linspace(0.0, end_s, 4000))
    peak = max(sum(contact(s)) for s in fine.T)
    return trace, end_s, sum(contact(last)), peak, last


LOSSES = {
    "tsuji": {},
    "kuwabara_kono": {"loss_law": kernel.KUWABARA_KONO_LOSS, "loss_constant": 3.9e-6},
    "hunt_crossley": {"loss_law": kernel.HUNT_CROSSLEY_LOSS, "loss_constant": 0.41},
}


@pytest.mark.parametrize("loss", LOSSES)
def test_trace_agrees_with_an_independent_integration_of_the_closed_equations(loss: str) -> None:
    """Third law, coupon's mass, lift-off at no force: the whole trace to 1e-8 of its peak."""
    bodies = closed(**LOSSES[loss])
    expected, end_s, _, _, last = independent(bodies)
    impact = simulate_impact(bodies, SPEED, points=1000)
    peak = np.max(np.abs(expected))
    assert np.max(np.abs(impact.compression_m - expected)) < 1e-8 * peak
    assert impact.contact_time_s == pytest.approx(end_s, rel=1e-8)
    assert impact.rebound_speed_m_per_s == pytest.approx(-last[1], rel=1e-8)


def test_trace_of_a_relaxing_contact_agrees_with_an_independent_integration() -> None:
    """With g 0.15 and tau 20 us as well, from touch-down through lift-off to the ring."""
    bodies = closed(terms=[ContactTerm(kernel.RELAXATION, (0.15, 20e-6))])
    expected, end_s, _, _, _ = independent(bodies, (0.15, 20e-6))
    impact = simulate_impact(bodies, SPEED, points=1000)
    assert np.max(np.abs(impact.compression_m - expected)) < 1e-8 * np.max(np.abs(expected))
    assert impact.contact_time_s == pytest.approx(end_s, rel=1e-8)


@pytest.mark.parametrize("relaxing", [False, True])
def test_the_force_is_zero_at_lift_off_and_never_pulls(relaxing: bool) -> None:
    """Zero to 1e-9 of the peak, while the indentation is not; the paper's dashpot would pull."""
    terms = [ContactTerm(kernel.RELAXATION, (0.15, 20e-6))] if relaxing else []
    impact = simulate_impact(closed(terms=terms), SPEED)
    assert abs(impact.lift_off_force_n) < 1e-9 * impact.peak_force_n
    assert impact.lift_off_indentation_m > 0.05 * impact.peak_indentation_m
    papers = simulate_impact(closed(terms=terms, lift_off_rule=kernel.AT_INDENTATION), SPEED)
    assert papers.contact_time_s > impact.contact_time_s
    if not relaxing:
        assert papers.lift_off_indentation_m == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("law", [kernel.JKR, kernel.DMT])
def test_surfaces_that_hardly_stick_let_the_dashpot_pull_no_more_than_bare_ones(law: int) -> None:
    """In the limit of no surface energy the record is that without adhesion."""
    bare = simulate_impact(closed(), SPEED, points=1000)
    sticky = simulate_impact(closed(law=law, law_value=1e-6), SPEED, points=1000)
    assert sticky.rebound_speed_m_per_s == pytest.approx(bare.rebound_speed_m_per_s, rel=1e-5)
    apart = np.max(np.abs(sticky.compression_m - bare.compression_m))
    assert apart < 1e-4 * np.max(bare.compression_m)


def test_without_loss_both_rules_of_lift_off_are_one() -> None:
    """A Hertzian force ends with its indentation."""
    by_force, by_depth = (
        simulate_impact(closed(restitution=1.0, lift_off_rule=rule), SPEED)
        for rule in (kernel.AT_FORCE, kernel.AT_INDENTATION)
    )
    np.testing.assert_array_equal(by_force.compression_m, by_depth.compression_m)
    assert by_force.contact_time_s == pytest.approx(by_depth.contact_time_s, rel=1e-12)


def test_energy_that_the_sphere_misses_is_in_the_ring_of_crystal_and_coupon() -> None:
    """Without any loss and weight; the ring's frequency is that of both masses."""
    bodies = closed(restitution=1.0, gravity_m_per_s2=0.0, cell_damping_n_s_per_m=0.0)
    impact = simulate_impact(bodies, SPEED, step_s=1e-8, points=60_000)
    k, M = bodies.cell_stiffness_n_per_m, bodies.cell_mass_kg + COUPON_KG
    after = impact.compression_m[int(impact.contact_time_s / 1e-8) + 10 :]
    missing = 0.5 * bodies.sphere_mass_kg * (SPEED**2 - impact.rebound_speed_m_per_s**2)
    assert 0.5 * k * np.max(np.abs(after)) ** 2 == pytest.approx(missing, rel=2e-6)
    crossings = np.flatnonzero(np.signbit(after[1:]) != np.signbit(after[:-1]))
    half_s = np.diff(crossings).mean() * 1e-8
    assert 0.5 / half_s == pytest.approx(math.sqrt(k / M) / (2 * math.pi), rel=1e-3)


def test_energy_is_balanced_with_losses_and_weight() -> None:
    """What came in is in the sphere, the crystal, the contact's dent or the dashpots."""
    bodies = closed()
    _, _, _, _, last = independent(bodies)
    impact = simulate_impact(bodies, SPEED)
    m, M = bodies.sphere_mass_kg, bodies.cell_mass_kg + COUPON_KG
    x, _, u, w, _, lost = last
    fell = m * G * impact.lift_off_place_m
    dent = 0.4 * bodies.contact_stiffness * (x - u) ** 2.5
    kept = 0.5 * m * impact.rebound_speed_m_per_s**2 + 0.5 * M * w * w
    kept += 0.5 * bodies.cell_stiffness_n_per_m * u * u + dent
    assert kept + lost == pytest.approx(0.5 * m * SPEED**2 + fell, rel=1e-9)


def test_momentum_of_sphere_and_crystal_is_kept_by_the_contact() -> None:
    """On a cell that is a free mass, a dashpot that pushes one body pushes the other as much."""
    free = {"cell_stiffness_n_per_m": 1.0, "cell_damping_n_s_per_m": 0.0, "gravity_m_per_s2": 0.0}
    m, M = 6.116e-4, 35.4e-3 + COUPON_KG
    kept = {}
    for third_law in (True, False):
        impact = simulate_impact(closed(third_law=third_law, **free), SPEED, points=400)
        top_speed = np.diff(impact.compression_m[-3:]).mean() / 1e-6
        kept[third_law] = (M * top_speed - m * impact.rebound_speed_m_per_s) / (m * SPEED)
    assert kept[True] == pytest.approx(1.0, abs=1e-5)
    assert abs(kept[False] - 1.0) > 1e-2


def test_a_coupon_on_its_tape_does_not_ride_on_the_crystal_too() -> None:
    """Its mass counts once: with a very stiff tape the record is that of one that rides."""
    taped = {"coupon_mass_kg": COUPON_KG, "layer_damping_n_s_per_m": 3e3}
    rides = simulate_impact(closed(), SPEED, points=1000).compression_m
    stiff = simulate_impact(closed(layer_stiffness_n_per_m=2e11, **taped), SPEED, points=1000)
    assert np.max(np.abs(stiff.compression_m - rides)) < 5e-3 * np.max(rides)


def test_a_rigid_cell_reads_the_whole_force() -> None:
    """With the third law it reads the momentum of the sphere; the paper reads the spring alone."""
    for third_law in (True, False):
        bodies = closed(third_law=third_law, rigid=True, gravity_m_per_s2=0.0)
        impact = simulate_impact(bodies, SPEED, step_s=1e-8, points=12_000)
        pushed = float(np.sum(impact.elastic_force_n)) * 1e-8
        turned = bodies.sphere_mass_kg * (SPEED + impact.rebound_speed_m_per_s)
        assert (pushed == pytest.approx(turned, rel=1e-4)) == third_law


@pytest.mark.parametrize("rule", [kernel.AT_INDENTATION, kernel.AT_FORCE])
@pytest.mark.parametrize("restitution", [0.95, 0.8, 0.65])
def test_constants_of_other_losses_give_the_restitution_they_are_made_for(
    rule: int, restitution: float
) -> None:
    """On a rigid cell without weight, at the speed in question."""
    rigid = closed(rigid=True, gravity_m_per_s2=0.0, lift_off_rule=rule)
    kono = kuwabara_kono_constant(
        restitution, SPEED, mass_kg=rigid.sphere_mass_kg,
        contact_stiffness=rigid.contact_stiffness, rule=rule,
    )  # fmt: skip
    crossley = hunt_crossley_constant(restitution, SPEED)
    for law, constant, rel in (
        (kernel.KUWABARA_KONO_LOSS, kono, 3e-4),
        (kernel.HUNT_CROSSLEY_LOSS, crossley, 1e-8),
    ):
        bodies = replace(rigid, loss_law=law, loss_constant=constant)
        rebound = simulate_impact(bodies, SPEED, points=1).rebound_speed_m_per_s
        assert rebound / SPEED == pytest.approx(restitution, rel=rel)


def test_small_losses_are_the_published_first_order() -> None:
    """Ramirez et al. 1999: (3/2) 1.15344 A v / D; Hunt & Crossley 1975: (2/3) chi v."""
    assert (5 / 4) ** 0.6 * 1.2 * beta(0.6, 1.5) == pytest.approx(1.5 * 1.15344, rel=1e-5)
    rigid = closed(rigid=True, gravity_m_per_s2=0.0)
    depth = (rigid.sphere_mass_kg * SPEED**2 / rigid.contact_stiffness) ** 0.4
    for law, constant, expected in (
        (kernel.KUWABARA_KONO_LOSS, 1e-8, 1.5 * 1.15344 * 1e-8 * SPEED / depth),
        (kernel.HUNT_CROSSLEY_LOSS, 1e-3, 2 / 3 * 1e-3 * SPEED),
    ):
        bodies = replace(rigid, loss_law=law, loss_constant=constant)
        rebound = simulate_impact(bodies, SPEED, points=1).rebound_speed_m_per_s
        assert 1.0 - rebound / SPEED == pytest.approx(expected, rel=5e-3)
    assert hunt_crossley_constant(1.0 - 1e-5, SPEED) == pytest.approx(1.5e-5 / SPEED, rel=1e-4)
