"""Effects on the closed base model against DOP853 with third law, coupon and an end by force."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from analysis.effects.library import effect_named
from analysis.errors import UnknownModelError
from analysis.model.effect_trace import Cell, Column, integrate_with_effects
from analysis.model.hertz import closed_damping_coefficient
from analysis.model.impact_model import model_named

from .conftest import Rig, apart
from .reference import Ground, Law

RIG = Rig()
K, R, M = RIG.stiffness, RIG.radius, RIG.mass
VISCOUS = closed_damping_coefficient(RIG.restitution) * math.sqrt(M * K)
LOADED = Ground([RIG.cell_mass + RIG.coupon_mass], [(0, -1, RIG.cell_stiffness, RIG.cell_damping)])


def _dashpot(d: float, r: float) -> float:
    return VISCOUS * max(d, 0.0) ** 0.25 * r


def _plain(d: float, r: float, z: Any) -> tuple[float, float, tuple[()]]:
    return K * d**1.5, _dashpot(d, r), ()


def _viscoelastic(a: float) -> Law:
    return lambda d, r, z: (K * d**1.5, _dashpot(d, r) + 1.5 * a * K * math.sqrt(d) * r, ())


def _relaxing(g: float, tau: float) -> Law:
    return lambda d, r, z: (
        K * d**1.5 + g * K * (d**1.5 - z[0]),
        _dashpot(d, r),
        ((d**1.5 - z[0]) / tau,),
    )


def _crossed(chi: float) -> Law:
    return lambda d, r, z: (K * d**1.5, _dashpot(d, r) + chi * K * d**1.5 * r, ())


def _sticking(gamma: float) -> Law:
    return lambda d, r, z: (K * d**1.5 - 4 * math.pi * gamma * R, _dashpot(d, r), ())


CASES: dict[str, tuple[str, dict[str, float], dict[str, Any]]] = {
    "viscoelastic": (
        "viscoelastic_damping",
        {"dissipation_time_s": 3e-6},
        {"law": _viscoelastic(3e-6)},
    ),
    "relaxation": (
        "stress_relaxation",
        {"strength": 0.3, "relaxation_time_s": 2e-5},
        {"law": _relaxing(0.3, 2e-5), "memories": 1},
    ),
    "Hunt and Crossley": (
        "hunt_crossley_damping",
        {"damping_s_per_m": 0.3},
        {"law": _crossed(0.3)},
    ),
    "adhesion": (
        "adhesion",
        {"surface_energy_j_per_m2": 0.5},
        {"law": _sticking(0.5), "bears": 4 * math.pi * 0.5 * R},
    ),
    "plate": (
        "plate_radiation",
        {"impedance_n_s_per_m": 150.0},
        {"law": _plain, "mobility": 1 / 150.0},
    ),
}


@pytest.mark.parametrize("case", CASES, ids=str)
def test_an_effect_on_the_closed_base_agrees_with_an_independent_integration(case: str) -> None:
    """Trace, contact time and rebound agree with DOP853 where the force ends the contact."""
    effect, values, how = CASES[case]
    found = RIG.predict(f"kv2+{effect}", {f"{effect}.{k}": v for k, v in values.items()})
    wanted = RIG.reference(ground=LOADED, share=1.0, **{"bears": 0.0} | how)
    assert apart(found.signal, wanted.compression) < 2e-6
    assert found.contact_time_s == pytest.approx(wanted.contact_time, rel=2e-6)
    assert found.rebound_ratio == pytest.approx(wanted.rebound / RIG.speed, abs=3e-6)


def _force(effect: str, values: dict[str, float], times: list[float]) -> Any:
    """Return the force between sphere and coupon at times after touch-down, the cell held still."""
    found = np.zeros((1, len(times)))
    step = times[1] - times[0]
    context = replace(
        RIG.context(),
        reacts=True,
        ends_with_force=True,
        sample_rate_hz=1 / step,
        touch_down_s=-times[0],
    )
    column = Column(0, np.zeros(0), {effect: values}, context)
    rigid = Cell(math.nan, math.nan, math.nan, 1.0)
    acting = [effect_named(effect)]
    outcome, _ = integrate_with_effects(found, acting, [column], [rigid], steps=400)
    return found[0], float(outcome[0, 0])


@pytest.mark.parametrize(
    ("effect", "values"),
    [
        ("stress_relaxation", {"strength": 0.15, "relaxation_time_s": 1.5e-5}),
        ("stress_relaxation", {"strength": 0.15, "relaxation_time_s": 2e-5}),
        ("viscoelastic_damping", {"dissipation_time_s": 3e-6}),
        ("hunt_crossley_damping", {"damping_s_per_m": 0.3}),
    ],
)
def test_a_contact_with_a_further_loss_ends_when_its_force_does(
    effect: str, values: dict[str, float]
) -> None:
    """The force never pulls, falls to zero where the contact ends, and stays zero."""
    times = [1e-8 * i for i in range(12_000)]
    force, end = _force(effect, values, times)
    assert force.min() >= -1e-9 * force.max()
    last, _ = _force(effect, values, [end * (1 - 1e-13), end])
    assert abs(last[0]) <= 1e-9 * force.max()
    after = np.array(times) > end
    assert after.any()
    assert not force[after].any()


def test_a_relaxing_contact_leaves_a_coupon_that_rings_on_its_tape() -> None:
    """After the end by force the coupon swings freely on its tape, as an integration has it."""
    k, c, g, tau = 5e8, 100.0, 0.15, 2e-5
    values = {"adhesive_layer.stiffness_n_per_m": k, "adhesive_layer.damping_n_s_per_m": c}
    values |= {"stress_relaxation.strength": g, "stress_relaxation.relaxation_time_s": tau}
    found = RIG.predict("kv2+adhesive_layer+stress_relaxation", values)
    links = [(0, -1, RIG.cell_stiffness, RIG.cell_damping), (1, 0, k, c)]
    ground = Ground([RIG.cell_mass, RIG.coupon_mass], links, top=1)
    wanted = RIG.reference(law=_relaxing(g, tau), memories=1, ground=ground, share=1.0, bears=0.0)
    assert apart(found.signal, wanted.compression) < 3e-6
    assert found.contact_time_s == pytest.approx(wanted.contact_time, rel=2e-6)


@pytest.mark.parametrize("base", ["kv", "hsd"])
def test_without_its_strength_relaxation_ends_the_papers_contact_as_the_paper_does(
    base: str,
) -> None:
    """At no strength the contact of the paper's bases lasts until the indentation is zero."""
    values = {"stress_relaxation.strength": 0.0, "stress_relaxation.relaxation_time_s": 2e-5}
    found = RIG.predict(f"{base}+stress_relaxation", values)
    plain = RIG.predict(base)
    assert found.contact_time_s == pytest.approx(plain.contact_time_s, rel=1e-7)
    relaxing = values | {"stress_relaxation.strength": 0.15}
    ends = RIG.predict(f"{base}+stress_relaxation", relaxing).contact_time_s
    assert ends < 0.99 * plain.contact_time_s


def test_a_tape_takes_the_coupon_off_the_crystal() -> None:
    """On its tape the coupon is a mass of its own, and counts once."""
    k, c = 5e8, 100.0
    values = {"adhesive_layer.stiffness_n_per_m": k, "adhesive_layer.damping_n_s_per_m": c}
    found = RIG.predict("kv2+adhesive_layer", values)
    links = [(0, -1, RIG.cell_stiffness, RIG.cell_damping), (1, 0, k, c)]
    ground = Ground([RIG.cell_mass, RIG.coupon_mass], links, top=1)
    wanted = RIG.reference(law=_plain, ground=ground, share=1.0, bears=0.0)
    assert apart(found.signal, wanted.compression) < 3e-6


def test_a_stiff_tape_is_the_closed_base_itself() -> None:
    """The stiffer the tape the nearer the coupon is to lying on the crystal."""
    values = {"adhesive_layer.stiffness_n_per_m": 1e11, "adhesive_layer.damping_n_s_per_m": 3e4}
    found = RIG.predict("kv2+adhesive_layer", values)
    assert apart(found.signal, RIG.predict("kv2").signal) < 5e-3


@pytest.mark.parametrize("effect", ["dashpot_reaction", "viscoelastic_damping:felt"])
def test_what_the_closed_base_holds_cannot_be_added_to_it(effect: str) -> None:
    """The dashpot's reaction is part of kv2, and so is that of every other loss."""
    with pytest.raises(UnknownModelError, match="cannot be added to 'kv2'"):
        model_named(f"kv2+{effect}")
