"""Closed physics and uncertain inputs together: kv2 on a simulated rig whose labels are off."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from analysis import fit_campaign
from analysis.campaign import Campaign
from analysis.fit.campaign_fit import solve
from analysis.fit.fit_shot import log_speed_in_air
from analysis.fit.freed_inputs import with_inputs
from analysis.fit.problem import JointProblem, build
from analysis.fit.result import FitResult
from analysis.fit.start import with_start
from analysis.fit.steps import along
from analysis.model.free_fall import speed_in_air
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign
from drivers.simulated.label_spread import TYPICAL
from drivers.simulated.noise import NoiseSettings
from drivers.simulated.specimens import SPHERES, SURFACES
from impactd.bench.simulated_campaign import through_a_folder

SEED = 18
SETTINGS = CampaignSettings(
    spheres={name: SPHERES[name] for name in ("acetal", "hdpe")},
    drop_heights_m=(0.0115, 0.0465),
    repeats=1,
    rig="closed",
    spread=TYPICAL,
    states_u=True,
)
SPECIMEN = "surface.specimen"
INPUTS = {"mass", "radius", "coupon_mass", "height_offset", "gravity", "time_base"} | {
    "air_resistance"
}


@pytest.fixture(scope="module")
def made() -> tuple[Campaign, dict[str, float]]:
    """Return a campaign of twelve drops and the true ln E' by global."""
    simulated = simulate_campaign(SETTINGS, SEED)
    true = {
        f"{side}.{name}": math.log(one["plane_strain_modulus_Pa"])
        for side in ("sphere", "surface")
        for name, one in simulated["truth"][f"{side}s"].items()
    }
    return through_a_folder(simulated), true


@pytest.fixture(scope="module")
def fit(made: tuple[Campaign, dict[str, float]]) -> FitResult:
    """Return its joint fit with the closed base model."""
    return fit_campaign(made[0], "kv2", heldout=False)


def test_kv2_with_declared_inputs_covers_the_truth(
    made: tuple[Campaign, dict[str, float]], fit: FitResult
) -> None:
    """Every modulus is within 2.6 u of the truth, and chi2 says that nothing is amiss."""
    assert fit.outcome.status == "converged"
    assert {one.kind for one in fit.problem.inputs} == INPUTS
    assert fit.misfit == 1.0
    for name, true in made[1].items():
        j = fit.problem.names.index(name)
        u = math.sqrt(float(fit.fitted.covariance[j, j]))
        assert abs(float(fit.fitted.theta[j]) - true) < 2.6 * u, name
    said = fit.moduli()["specimen"]["plane_strain_modulus_Pa"]
    assert said["interval95"][0] <= math.exp(made[1][SPECIMEN]) <= said["interval95"][1]


def test_a_kv2_fit_carries_a_budget_of_its_inputs(fit: FitResult) -> None:
    """The specimen's table names masses, radii, heights and coupons, and adds up to its u."""
    said = fit.moduli()["specimen"]["plane_strain_modulus_Pa"]
    one = fit.budget()["moduli"]["specimen"]["plane_strain_modulus_Pa"]
    assert {
        "spheres.acetal.mass_kg",
        "spheres.acetal.radius_m",
        "surfaces.specimen.coupon_mass_kg",
        "release.height_offset_u_m",
        "gravity_m_per_s2",
        "noise",
    } <= {row["input"] for row in one["rows"]}
    squares = sum(row["contribution"] ** 2 for row in one["rows"])
    assert one["relative_u"] == pytest.approx(math.sqrt(squares), rel=1e-9)
    assert one["relative_u"] == pytest.approx(said["u"] / said["value"], rel=1e-9)


SHIFT = 2e-3


def _shifted(campaign: Campaign, kind: str) -> tuple[Campaign, float]:
    """Return a campaign with one kind of numbers stated 0.2 % higher, and the log of that."""
    more = 1 + SHIFT
    if kind == "gravity":
        return dataclasses.replace(
            campaign, gravity_m_per_s2=campaign.gravity_m_per_s2 * more
        ), math.log(more)
    if kind == "coupon_mass":
        surfaces = {
            n: dataclasses.replace(one, coupon_mass_kg=(one.coupon_mass_kg or 0.0) * more)
            for n, one in campaign.surfaces.items()
        }
        return dataclasses.replace(campaign, surfaces=surfaces), math.log(more)
    field = {"mass": "mass_kg", "radius": "radius_m"}[kind]
    spheres = {
        n: dataclasses.replace(one, **{field: getattr(one, field) * more})
        for n, one in campaign.spheres.items()
    }
    return dataclasses.replace(campaign, spheres=spheres), math.log(more)


@pytest.mark.parametrize("kind", ["mass", "radius", "coupon_mass", "gravity"])
def test_sensitivities_of_kv2_are_what_a_fit_at_shifted_inputs_gives(
    made: tuple[Campaign, dict[str, float]], fit: FitResult, kind: str
) -> None:
    """Numbers stated higher move the modulus as the covariance says they do."""
    other, by = _shifted(made[0], kind)
    # the same uncertainties in both: only the stated values move
    j = fit.problem.names.index(SPECIMEN)
    follows = fit.fitted.covariance[j] @ fit.problem.prior_precision
    promised = by * sum(
        float(follows[fit.problem.names.index(i.name)])
        for i in fit.problem.inputs
        if i.kind == kind
    )
    moved = fit_campaign(other, "kv2", heldout=False).fitted.theta[j] - fit.fitted.theta[j]
    assert float(moved) == pytest.approx(promised, rel=0.03, abs=2e-6)


def test_undeclared_inputs_are_taken_as_exact_and_state_too_little(
    made: tuple[Campaign, dict[str, float]], fit: FitResult
) -> None:
    """The same records without u of inputs state too little."""
    exact = fit_campaign(_undeclared(made[0]), "kv2", heldout=False)
    assert {one.kind for one in exact.problem.inputs} == {"air_resistance"}  # no campaign states it
    assert any("surfaces.specimen.coupon_mass_kg" in said for said in exact.problem.assumptions)
    wide, narrow = (f.moduli()["specimen"]["plane_strain_modulus_Pa"]["u"] for f in (fit, exact))
    assert narrow < wide


def _undeclared(campaign: Campaign) -> Campaign:
    return dataclasses.replace(
        campaign,
        shots=tuple(dataclasses.replace(s, u_drop_height_m=None) for s in campaign.shots),
        spheres={
            n: dataclasses.replace(one, u_radius_m=None, u_mass_kg=None)
            for n, one in campaign.spheres.items()
        },
        surfaces={
            n: dataclasses.replace(one, u_coupon_mass_kg=None)
            for n, one in campaign.surfaces.items()
        },
        u_gravity_m_per_s2=None,
        u_height_offset_m=None,
        u_sample_rate_relative=None,
    )


@pytest.fixture(scope="module")
def problem(made: tuple[Campaign, dict[str, float]]) -> JointProblem:
    """Return the joint problem with its inputs freed, at its start."""
    found, _ = with_start(build(made[0], model_named("kv2")))
    return with_inputs(found)


@pytest.mark.parametrize("kind", sorted(INPUTS - {"time_base"}))
def test_the_speed_of_fall_and_the_riding_mass_follow_the_inputs(
    problem: JointProblem, kind: str
) -> None:
    """A moved shot falls through air at the moved numbers, and bears the moved coupon."""
    item = problem.shots[0]
    theta = problem.start.copy()
    ((j, one),) = [(j, i) for j, i in problem.inputs_of(item) if i.kind == kind]
    theta[j] += 3 * one.u
    moved = problem.item_at(item, theta)
    f = moved.frame
    assert moved.speed_prior is not None
    assert item.speed_prior is not None
    assert f.drop_height_m is not None
    assert f.radius_m is not None
    fall = f.drop_height_m, f.radius_m, f.mass_kg, f.gravity_m_per_s2
    expected = speed_in_air(*fall, resistance=moved.air_resistance)
    assert moved.speed_prior.mean == math.log(expected)
    assert (moved.speed_prior.mean == item.speed_prior.mean) == (kind == "coupon_mass")
    assert f.coupon_on_crystal_kg == f.coupon_mass_kg
    assert (f.coupon_on_crystal_kg == item.frame.coupon_on_crystal_kg) == (kind != "coupon_mass")


def test_nothing_falls_from_no_height_or_in_air_that_bears_it(problem: JointProblem) -> None:
    """Such a speed has the logarithm minus infinity, so that a fit steps back."""
    frame = problem.shots[0].frame
    for change in ({"drop_height_m": 0.0}, {"mass_kg": 1e-9}):
        assert log_speed_in_air(dataclasses.replace(frame, **change)) == -math.inf


def test_an_input_that_no_double_holds_is_refused(problem: JointProblem) -> None:
    """A step that makes a mass e^400 times its label has no trace and infinite cost."""
    theta = problem.start.copy()
    theta[problem.names.index("input.mass.acetal")] += 400.0
    assert not problem.is_thinkable(theta)
    values, _ = problem.shared_local(problem.item_at(problem.shots[0], theta), theta)
    assert not problem.model.is_thinkable(np.concatenate([values, np.zeros(4)]))


@pytest.fixture(scope="module")
def one_coupon() -> Campaign:
    """Return drops of three spheres on one coupon, as a calibration has them."""
    settings = dataclasses.replace(
        SETTINGS,
        spheres={name: SPHERES[name] for name in ("acetal_small", "hdpe", "ptfe")},
        surfaces={"aluminium": SURFACES["aluminium"]},
        drop_heights_m=(0.016, 0.0185, 0.027),
        noise=NoiseSettings(rms_v=9e-4, ar1=0.0, pink_corner_hz=0.0),
    )
    return through_a_folder(simulate_campaign(settings, 1002))


def test_drops_on_one_coupon_do_not_creep(one_coupon: Campaign) -> None:
    """What is crystal and what is coupon stays open there, and the fit settles in few steps."""
    problem, nuisances = with_start(build(one_coupon, model_named("kv2")))
    fitted, _ = solve(problem, nuisances)
    assert fitted.converged
    assert fitted.iterations <= 30
    freed = fit_campaign(one_coupon, "kv2", heldout=False)
    assert freed.problem.inputs
    assert freed.outcome.status == "converged"
    assert freed.fitted.iterations <= 30


def test_a_step_keeps_the_ring_of_the_loaded_cell_straight(problem: JointProblem) -> None:
    """Whatever a step makes of crystal and coupons, the loaded ring moves as it says."""
    mass = float(np.mean([s.frame.coupon_on_crystal_kg for s in problem.shots]))
    names = [*problem.names]
    step = np.zeros(len(names))
    at = [names.index(f"sensor.{n}") for n in ("ln_w", "ln_z", "ln_M")]
    step[at] = 1e-3, 2e-3, -0.4

    def loaded(theta: np.ndarray, j: int) -> float:
        return float(theta[j] - 0.5 * np.log1p(mass * np.exp(-theta[at[2]])))

    moved = along(problem, problem.start, step)
    share = mass / (mass + math.exp(problem.start[at[2]]))
    for j in at[:2]:
        straight = step[j] + 0.5 * share * step[at[2]]
        assert loaded(moved, j) - loaded(problem.start, j) == pytest.approx(straight, rel=1e-9)
    tiny = 1e-6 * step
    assert along(problem, problem.start, tiny) - problem.start == pytest.approx(tiny, abs=1e-10)
