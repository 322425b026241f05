"""The budgets of a network of moduli against its own covariance, a formula and sampling."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest
from uncertainties import ufloat
from uncertainties.umath import exp, log

from analysis.budget import Budget
from analysis.campaign import Quantity, Sphere, Surface, Uncertainty
from analysis.moduli import Adjustment, adjust_network
from analysis.moduli_budget import network_budgets, network_budgets_json
from analysis.moduli_network import build, grouped, solve
from analysis.pair_observation import PairObservation

RATIO = Quantity(0.36, 0.01)
PLANE = {"a": 3.2e9, "b": 1.2e9, "s": 70e9, "x": 1.6e9}
"""True E'. [Pa]"""
SPHERES = {
    "a": Sphere(
        "a",
        4.76e-3,
        6e-4,
        Quantity(PLANE["a"] * (1 - RATIO.value**2), 2e7),
        RATIO,
        u_mass_kg=Uncertainty(3e-6, "rectangular", traceable_to="balance 4"),
    ),
    "b": Sphere("b", 4.76e-3, 6e-4, None, RATIO),
}
SURFACES = {
    "s": Surface("s", Quantity(PLANE["s"] * (1 - RATIO.value**2), 7e8), RATIO),
    "x": Surface("x", None, RATIO),
}
INPUTS = {"input.mass.a": 2e-3, "input.height_offset": -3e-3, "input.time_base": 1e-5}
INPUT_U = {"input.mass.a": 5e-3, "input.height_offset": 0.3, "input.time_base": 25e-6}
CELLS = {"3": np.diag([1e-6, 4e-6, 0.0, 9e-6]) + 1e-9, "4": 1e-6 * np.eye(4)}


def observed(scatter: float = 1e-3, seed: int = 1) -> list[PairObservation]:
    """Return two calibrations' worth of fits that scatter by so much and state 1e-3."""
    rng = np.random.default_rng(seed)
    found = []
    for shot in range(24):
        sphere, surface = "ab"[shot % 2], "sx"[shot // 2 % 2]
        exact = -math.log(1 / PLANE[sphere] + 1 / PLANE[surface])
        found.append(
            PairObservation(
                sphere=sphere,
                surface=surface,
                log_reduced_modulus=exact + scatter * rng.standard_normal(),
                u_random=1e-3,
                sensitivity=np.array([0.1, 0.2, 0.0, 0.7 + 0.01 * shot]),
                shot=f"shot {shot}",
                model="kv",
                calibration="3" if shot < 12 else "4",
                inputs={k: u for k, u in INPUTS.items() if not k.endswith(".a") or sphere == "a"},
                input_u=INPUT_U,
            )
        )
    return found


def adjusted(observations: list[PairObservation]) -> Adjustment:
    """Return the network under both calibrations, one of which rests on the mass too."""
    calibrated_by = {"3": {"input.mass.a": np.array([0.0, 0.0, 0.0, 1e-3])}}
    return adjust_network(observations, SPHERES, SURFACES, CELLS, calibrated_by)


def the(found: list[Budget], name: str, measurand: str = "plane_strain_modulus_Pa") -> Budget:
    """Return one budget."""
    (one,) = [b for b in found if (b.name, b.measurand) == (name, measurand)]
    return one


@pytest.mark.parametrize("scatter", [1e-3, 1e-2])
def test_contributions_add_up_to_what_the_network_states(scatter: float) -> None:
    """For every modulus the rows' squares are its variance, also where uncertainty was added."""
    adjustment = adjusted(observed(scatter))
    moduli = adjustment.result.moduli()
    assert (adjustment.result.dark_u > 0) == (scatter > 1e-3)
    found = network_budgets(adjustment)
    assert len(found) == 2 * len(moduli)
    for budget in found:
        said = moduli[budget.name.partition(".")[2]][budget.measurand]
        assert budget.value == pytest.approx(said["value"], rel=1e-12)
        assert budget.relative_u == pytest.approx(said["u"] / said["value"], rel=1e-8)
    json.dumps(network_budgets_json(adjustment), allow_nan=False)


def test_one_pair_agrees_with_another_program() -> None:
    """For one pair the package ``uncertainties`` gives the same rows for 1/E' = 1/E* - 1/E'_a."""
    (one,) = [o for o in observed() if o.shot == "shot 2"]
    found = network_budgets(adjust_network([one], SPHERES, SURFACES, CELLS))
    budget = the(found, "surface.x")
    young, nu = ufloat(2.785e9, 2e7), ufloat(RATIO.value, RATIO.u)
    assert SPHERES["a"].youngs_modulus_pa is not None
    young = ufloat(SPHERES["a"].youngs_modulus_pa.value, 2e7)
    errors = {name: ufloat(0.0, 1.0) for name in INPUTS}
    cell = [ufloat(0.0, math.sqrt(v)) for v in (1e-6, 4e-6, 1e-9, 9e-6)]
    noise = ufloat(0.0, 1e-3)
    seen = one.log_reduced_modulus + noise
    seen -= sum(INPUTS[name] * e for name, e in errors.items())
    seen -= sum(s * e for s, e in zip(one.sensitivity, cell, strict=True))
    theirs = log(1 / (exp(-seen) - (1 - nu**2) / young))
    assert budget.relative_u == pytest.approx(theirs.std_dev, rel=2e-3)  # the cell's 1e-9 more
    parts = theirs.error_components()
    rows = {r.source.name: r.contribution for r in budget.rows}
    assert rows["noise"] == pytest.approx(parts[noise], rel=1e-4)
    assert rows["spheres.a.mass_kg"] == pytest.approx(parts[errors["input.mass.a"]], rel=1e-4)
    assert rows["spheres.a.youngs_modulus_Pa"] == pytest.approx(parts[young], rel=1e-4)
    assert rows["spheres.a.poissons_ratio"] == pytest.approx(parts[nu], rel=1e-4)


def test_sampled_networks_scatter_as_the_budget_says() -> None:
    """Every stated number drawn and every recording repeated: the moduli's u is the budget's."""
    rng, count = np.random.default_rng(7), 200
    exact = [dataclasses.replace(o, log_reduced_modulus=m) for o, m in _exact(observed())]
    known = {name: np.diag([1e-6, 4e-6, 1e-9, 9e-6]) for name in CELLS}
    nominal = adjust_network(exact, SPHERES, SURFACES, known)
    logs = np.empty((count, len(nominal.result.names)))
    for draw in range(count):
        cell = {n: rng.multivariate_normal(np.zeros(4), c) for n, c in known.items()}
        inputs = {name: rng.standard_normal() for name in INPUTS}
        seen = [
            dataclasses.replace(
                o,
                log_reduced_modulus=o.log_reduced_modulus
                + 1e-3 * rng.standard_normal()
                + float(o.sensitivity @ cell[o.calibration])
                + sum(u * inputs[name] for name, u in o.inputs.items()),
            )
            for o in exact
        ]
        system = build(seen, _restated(SPHERES, rng), _restated(SURFACES, rng), known)
        logs[draw] = solve(system, grouped(system))[0][: logs.shape[1]]
    budgets = network_budgets(nominal)
    for name, values in zip(nominal.result.names, logs.T, strict=True):
        # a standard deviation of 200 draws is good to 1/sqrt(2 * 199) = 5 %; four of that
        stated = the(budgets, name).relative_u
        assert values.std(ddof=1) == pytest.approx(stated, rel=0.2), name


def _exact(observations: list[PairObservation]) -> list[tuple[PairObservation, float]]:
    return [(o, -math.log(1 / PLANE[o.sphere] + 1 / PLANE[o.surface])) for o in observations]


def _restated(materials: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Return materials as their stated moduli might have been said, of the same truth."""

    def said(known: Quantity | None) -> Quantity | None:
        return known and Quantity(known.value + known.u * rng.standard_normal(), known.u)

    return {
        name: dataclasses.replace(
            one,
            youngs_modulus_pa=said(one.youngs_modulus_pa),
            poissons_ratio=said(one.poissons_ratio),
        )
        for name, one in materials.items()
    }


def test_rows_say_value_u_and_source_of_what_is_stated_today() -> None:
    """A mass has its value in kg and its balance; where fits took another u, the balance is not."""
    budget = the(network_budgets(adjusted(observed())), "surface.x")
    rows = {r.source.name: r for r in budget.rows}
    mass = rows["spheres.a.mass_kg"].source
    assert (mass.value, mass.uncertainty.u, mass.unit) == (6e-4, 3e-6, "kg")
    assert mass.uncertainty.traceable_to == "balance 4"
    offset = rows["release.height_offset_u_m"].source
    assert (offset.uncertainty.u, offset.unit) == (pytest.approx(3e-4), "m")
    assert rows["sensor"].source.label == "load cell, 2 calibrations"
    assert not rows["noise"].source.common

    older = [dataclasses.replace(o, input_u=INPUT_U | {"input.mass.a": 0.01}) for o in observed()]
    rows = {r.source.name: r for r in the(network_budgets(adjusted(older)), "surface.x").rows}
    mass = rows["spheres.a.mass_kg"].source
    assert mass.uncertainty.u == pytest.approx(6e-6)
    assert mass.uncertainty.traceable_to is None


def test_what_no_reference_reaches_has_no_budget() -> None:
    """A withheld modulus is left out; the others keep theirs."""
    bare = {**SPHERES, "b": Sphere("b", None, None, None, RATIO)}
    alone = {"y": Surface("y", None, RATIO), **SURFACES}
    mixed = [
        dataclasses.replace(o, surface="y") if o.sphere == "b" else o
        for o in observed()
        if (o.sphere, o.surface) != ("b", "s")
    ]
    found = network_budgets_json(adjust_network(mixed, bare, alone, CELLS))
    assert {"a", "s", "x"} == set(found["moduli"])


def test_the_sentence_says_what_to_do() -> None:
    """Whatever dominates is what the sentence asks for: the mass, the cell, or a diagnosis."""
    few = [o for o in observed() if (o.sphere, o.surface) == ("a", "x")]
    heavy = [dataclasses.replace(o, inputs=o.inputs | {"input.mass.a": 0.05}) for o in few]
    sure = {name: 1e-12 * np.eye(4) for name in CELLS}
    told = the(network_budgets(adjust_network(heavy, SPHERES, SURFACES, sure)), "surface.x")
    assert told.advice().startswith("Measure the mass of the sphere a to 0.0")
    loose = {name: 1e-2 * np.eye(4) for name in CELLS}
    told = the(network_budgets(adjust_network(few, SPHERES, SURFACES, loose)), "surface.x")
    assert told.advice().startswith("Calibrate the load cell with more drops")
    apart = [dataclasses.replace(o, inputs={}) for o in observed(0.3)]
    told = the(network_budgets(adjust_network(apart, SPHERES, SURFACES, sure)), "surface.x")
    assert told.advice().startswith("Find out why the recordings do not fit together")
