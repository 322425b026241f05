"""Relaxation: its forms against their own laws, its end, and what the exact law would give."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import beta

from analysis.effects.effect import Effect
from analysis.effects.library import effect_named, library
from analysis.model.impact_model import model_named

from .conftest import Rig, apart
from .ting import TingImpact

RIG = Rig(restitution=1.0)
REFERENCE_S = 5e-5
POWER_LAW = "stress_relaxation:power_law"
CAN_PULL = {
    "stress_relaxation": {"strength": 0.15, "relaxation_time_s": 2e-5},
    "stress_relaxation:maxwell": {
        "strength": 0.15,
        "slow_strength": 0.1,
        "relaxation_time_s": 1e-5,
    },
    POWER_LAW: {"exponent": 0.08},
    "viscoelastic_damping:felt": {"dissipation_time_s": 3e-6},
    "hunt_crossley_damping:felt": {"damping_s_per_m": 0.3},
}


def _values(effect: str, numbers: dict[str, float]) -> dict[str, float]:
    return {f"{effect}.{name}": value for name, value in numbers.items()}


@pytest.mark.parametrize("effect", CAN_PULL)
@pytest.mark.parametrize("restitution", [0.85, 1.0])
def test_no_effect_on_the_papers_base_makes_the_cell_feel_a_pull(
    effect: str, restitution: float
) -> None:
    """What a rigid cell reads of a relaxing or viscous contact never turns negative."""
    rig = Rig(restitution=restitution)
    found = rig.predict(f"hsd+{effect}", _values(effect, CAN_PULL[effect]))
    assert found.signal.min() >= -1e-9 * found.signal.max()
    inside = found.signal[found.signal > 0.0]
    # no jump at the end either: the force falls to zero, by no more than a sample's share
    assert inside[-1] < 0.1 * inside.max()


def _forms() -> list[Effect]:
    return [form for form in library()["stress_relaxation"].variants if form.by_name]


@pytest.mark.parametrize("form", _forms(), ids=lambda f: f.id)
def test_a_form_for_names_only_is_found_by_its_name(form: Effect) -> None:
    """A model may name it."""
    assert model_named(f"kv2+{form.id}").effects == (form,)


def test_two_arms_of_which_one_is_idle_are_one() -> None:
    """Without its slow arm the Maxwell form is the standard linear solid."""
    one = {"strength": 0.2, "relaxation_time_s": 2e-5}
    solid = RIG.predict("kv2+stress_relaxation", _values("stress_relaxation", one))
    form = "stress_relaxation:maxwell"
    both = RIG.predict(f"kv2+{form}", _values(form, one | {"slow_strength": 0.0}))
    assert apart(both.signal, solid.signal) < 1e-12


def _packed(b: float) -> tuple[np.ndarray, np.ndarray, float, float]:
    """Return strengths and times of the arms, the spring over K, and the dashpot's time."""
    pack = effect_named(POWER_LAW).pack
    assert pack is not None
    rows = np.array(pack({"exponent": b}, RIG.context())).reshape(-1, 4)
    return rows[:, 0], rows[:, 1], 1.0 + rows[0, 2], rows[0, 3] / (1.5 * RIG.stiffness)


@pytest.mark.parametrize(("b", "allowed"), [(0.02, 3e-4), (0.1, 1e-3), (0.3, 3.2e-3)])
def test_the_arms_of_the_power_law_add_up_to_it(b: float, allowed: float) -> None:
    """From 5 to 500 us the relaxation function is the power, its loss tangent tan(pi b / 2)."""
    g, tau, spring, viscous_s = _packed(b)
    t = np.geomspace(5e-6, 5e-4, 50)
    relaxing = spring + np.exp(-t[:, None] / tau) @ g
    assert np.abs(relaxing * (t / REFERENCE_S) ** b - 1).max() < allowed
    w = 1j * np.geomspace(5e3, 2e5, 50)
    dynamic = spring + (w[:, None] * tau / (1 + w[:, None] * tau)) @ g + w * viscous_s
    assert (dynamic.imag / dynamic.real) == pytest.approx(math.tan(math.pi * b / 2), rel=0.02)


def test_the_power_law_has_lee_and_radoks_force_at_constant_speed() -> None:
    """Pressed in at constant speed the force grows like t^(3/2 - b), with the published factor."""
    b, v, K = 0.1, 0.5, RIG.stiffness
    form = effect_named(POWER_LAW)
    assert form.pack is not None
    rows = np.array(form.pack({"exponent": b}, RIG.context())).reshape(-1, 4)

    def held(t: float, z: np.ndarray) -> list[float]:
        elastic = K * (v * t) ** 1.5
        return [form.contact(v * t, v, elastic, *at)[2] for at in zip(z, *rows.T, strict=True)]

    times = np.array([2e-5, 5e-5, 1e-4])
    found = solve_ivp(held, (0, 1e-4), np.zeros(len(rows)), "LSODA", times, rtol=1e-9, atol=1e-9)
    for t, z in zip(times, found.y.T, strict=True):
        elastic = K * (v * t) ** 1.5
        added = sum(form.contact(v * t, v, elastic, *at)[0] for at in zip(z, *rows.T, strict=True))
        wanted = K * REFERENCE_S**b * v**1.5 * 1.5 * beta(1.5, 1 - b) * t ** (1.5 - b)
        assert elastic + added == pytest.approx(wanted, rel=1e-3)


def test_an_impact_by_the_power_law_agrees_with_its_integral() -> None:
    """On a rigid cell the force is that of the hereditary integral, summed over all of the past."""
    b, dt, K = 0.1, 5e-8, RIG.stiffness
    x, v, a, times, forces, w = 0.0, RIG.speed, 9.80665, [0.0], [0.0], [0.0]
    while forces[-1] > 0.0 or len(times) < 10:
        x, before = x + dt * (v + 0.5 * dt * a), a
        times.append(times[-1] + dt)
        w.append(max(x, 0.0) ** 1.5)
        ahead = times[-1] - np.array(times)
        kernel = -np.diff(ahead ** (1 - b)) / (1 - b)
        forces.append(K * REFERENCE_S**b * float(np.diff(w) / dt @ kernel))
        a = 9.80665 - forces[-1] / RIG.mass
        v += 0.5 * dt * (before + a)
    found = RIG.predict(f"hsd+{POWER_LAW}", {f"{POWER_LAW}.exponent": b})
    wanted = np.interp(RIG.times, times, forces, left=0.0, right=0.0)
    assert apart(found.signal, wanted) < 1.5e-3
    assert found.contact_time_s == pytest.approx(times[-1], rel=2e-3)
    assert found.rebound_ratio == pytest.approx(-v / RIG.speed, abs=1e-3)


def test_the_power_law_loses_the_same_at_every_speed_but_for_the_contact_time() -> None:
    """To first order in b the loss does not depend on the time: twice the speed, the same eps."""
    values = {f"{POWER_LAW}.exponent": 0.02}
    lost = [
        1 - RIG.but(speed=v).predict(f"hsd+{POWER_LAW}", values).rebound_ratio for v in (0.5, 1.0)
    ]
    assert lost[0] == pytest.approx(lost[1], rel=0.03)
    assert lost[1] > 0.01


def _loss_over_time_ratio(*, exact: bool) -> float:
    """Return (1 - eps) tau / T of a Maxwell solid, T Hertz's contact time."""
    K, m, v, ratio = RIG.stiffness, RIG.mass, RIG.speed, 1e-3
    duration = 2.943275 * (1.25 * m * v**2 / K) ** 0.4 / v
    impact = TingImpact(K, m, v, ((1.0, duration / ratio),), relaxed=0.0, exact=exact)
    _, _, rebound = impact.solve(np.linspace(0.0, 2 * duration, 9))
    return (1 - rebound / v) / ratio


def test_tings_law_has_hunters_restitution() -> None:
    """A Maxwell solid loses 4/9 T/tau of the speed by Ting's law, 5/9 by the plain integral."""
    assert _loss_over_time_ratio(exact=True) == pytest.approx(4 / 9, rel=1e-3)
    assert _loss_over_time_ratio(exact=False) == pytest.approx(5 / 9, rel=1e-2)


def test_the_effect_is_the_plain_integral() -> None:
    """On a closed rig the effect is the integral, 1.1 % of the peak away from Ting's law."""
    g, tau, times = 0.15, 2e-5, RIG.times
    bodies = (RIG.stiffness, RIG.mass, RIG.speed, ((g, tau),))
    cell = {
        "top_mass": RIG.cell_mass + RIG.coupon_mass,
        "cell_stiffness": RIG.cell_stiffness,
        "cell_damping": RIG.cell_damping,
        "gravity": 9.80665,
    }
    plain, end, rebound = TingImpact(*bodies, **cell, exact=False).solve(times)  # type: ignore[arg-type]
    values = {"strength": g, "relaxation_time_s": tau}
    found = RIG.predict("kv2+stress_relaxation", _values("stress_relaxation", values))
    assert apart(found.signal, plain / RIG.compliance_m_per_v) < 1e-5
    assert found.contact_time_s == pytest.approx(end, rel=1e-5)
    assert found.rebound_ratio == pytest.approx(rebound / RIG.speed, abs=1e-5)
    exact, later, _ = TingImpact(*bodies, **cell).solve(times)  # type: ignore[arg-type]
    assert apart(exact, plain) == pytest.approx(0.011, rel=0.1)
    assert later > end


@pytest.mark.parametrize(
    ("effect", "name", "value"),
    [
        (POWER_LAW, "exponent", 1.0),
        (POWER_LAW, "exponent", -1.0),
        (POWER_LAW, "exponent", 2.0),
        ("coupon_mode:off_centre", "tilt_over_compression", -1.0),
        ("coupon_mode:off_centre", "tilt_over_compression", -1.3),
    ],
)
def test_a_value_without_a_meaning_gives_no_number(effect: str, name: str, value: float) -> None:
    """A step of a fit to where a law has no value is seen as such, and stops nothing."""
    found = RIG.predict(f"kv2+{effect}", {f"{effect}.{name}": value})
    assert not np.isfinite(found.contact_time_s)
