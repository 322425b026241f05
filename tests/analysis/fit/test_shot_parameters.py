"""An effect's number that belongs to the shot: found for each shot, eliminated like its speed."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from analysis.effects.effect import Effect
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.blocks import linearise_shot, shot_cost
from analysis.fit.nuisances import carried_over, fresh
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.model.impact_model import ImpactModel, model_named
from drivers.simulated.campaign import CampaignSettings
from drivers.simulated.effects import Shot
from drivers.simulated.effects.coupon_mode import CouponMode
from drivers.simulated.impact import Mechanics
from impactd.bench.simulated_campaign import simulated_campaign

TRUTH = {"frequency_hz": 2.6e4, "damping_ratio": 0.02, "mass_ratio": 0.04, "hit_scatter": 0.35}


class TellingCouponMode(CouponMode):
    """The simulator's mode, which writes down what took part in each shot."""

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies and remember."""
        super().before_impact(mechanics, shot, speed_m_per_s)
        self.seen[shot.number] = mechanics.mode_mass_kg / mechanics.loaded_cell_mass_kg

    def __post_init__(self) -> None:
        """Begin with nothing seen."""
        super().__post_init__()
        self.seen: dict[int, float] = {}


def by_shot() -> Effect:
    """Return the library's coupon mode with its amplitude by shot, from a near frequency."""
    mode = effect_named("coupon_mode")
    amplitude, frequency, damping = mode.parameters
    return dataclasses.replace(
        mode,
        parameters=(
            dataclasses.replace(amplitude, scope="shot"),
            dataclasses.replace(frequency, scope="rig", starts=(2.5e4,)),
            dataclasses.replace(damping, scope="rig"),
        ),
    )


def model_by_shot() -> ImpactModel:
    """Return the crystal model with a coupon mode that each shot excites by its own."""
    return model_named("kv2").with_effect(by_shot())


@pytest.fixture(scope="module")
def simulated() -> tuple[JointProblem, joint.Fitted, np.ndarray]:
    """Return problem, fit and true shares of eighteen drops."""
    mode = TellingCouponMode(TRUTH)
    settings = CampaignSettings(effects=(mode,), repeats=1)
    problem, nuisances = with_start(build(simulated_campaign(settings, 5), model_by_shot()))
    fitted = joint.fit(problem, nuisances)
    return problem, fitted, np.array([mode.seen[n] for n in sorted(mode.seen)])


def test_each_shot_has_its_own_amplitude(
    simulated: tuple[JointProblem, joint.Fitted, np.ndarray],
) -> None:
    """The mass that took part is found shot by shot, frequency and damping for the rig."""
    problem, fitted, truth = simulated
    assert fitted.converged
    place = problem.model.nuisances.index("coupon_mode.mass_share")
    found = 0.1 * fitted.nuisances[:, place]
    u = np.array(
        [
            0.1 * math.sqrt(joint.nuisance_covariance(problem, fitted, row)[place, place])
            for row in range(truth.size)
        ]
    )
    assert np.abs((found - truth) / u).max() < 4.0
    assert np.corrcoef(found, truth)[0, 1] > 0.99
    for name in ("frequency_hz", "damping_ratio"):
        j = problem.names.index(f"coupon_mode.{name}")
        miss = float(fitted.theta[j]) - math.log(TRUTH[name])
        assert abs(miss) < 4 * math.sqrt(fitted.covariance[j, j]), name
    samples = sum(s.frame.samples - s.noise.order - 5 for s in problem.shots)
    assert sum(b.chi2 for b in fitted.blocks) / samples == pytest.approx(1.0, abs=0.03)


def test_what_belongs_to_the_shot_is_no_global(
    simulated: tuple[JointProblem, joint.Fitted, np.ndarray],
) -> None:
    """The number stands behind the four nuisances, and no owner is named for it."""
    problem, fitted, _ = simulated
    model = problem.model
    assert model.nuisances[4:] == ("coupon_mode.mass_share",)
    assert "coupon_mode.mass_share" not in model.shared
    assert [n for n in problem.names if n.startswith("coupon_mode")] == [
        "coupon_mode.frequency_hz",
        "coupon_mode.damping_ratio",
    ]
    shared, chain = problem.shared_local(problem.shots[0], fitted.theta)
    assert shared.size == chain.shape[0] == len(model.shared)


def test_the_normal_equations_are_those_of_the_cost(
    simulated: tuple[JointProblem, joint.Fitted, np.ndarray],
) -> None:
    """Half the cost's slope by a shot's own number is the normal equations' right-hand side."""
    problem, fitted, _ = simulated
    item, nuisance = problem.shots[3], fitted.nuisances[3].copy()
    nuisance[4] += 0.05
    block = linearise_shot(problem, item, fitted.theta, nuisance)
    assert block is not None
    above, below = nuisance.copy(), nuisance.copy()
    above[4] += 1e-5
    below[4] -= 1e-5
    slope = shot_cost(problem, item, fitted.theta, above)
    slope -= shot_cost(problem, item, fitted.theta, below)
    assert block.vector[-1] == pytest.approx(-slope / 4e-5, rel=1e-4)


def test_nuisances_are_carried_over_by_name() -> None:
    """Adding or taking off an effect leaves every other number of a shot where it belongs."""
    plain = model_named("kv2+mains_hum")
    more = plain.with_effect(by_shot())
    values = np.arange(2.0 * len(plain.nuisances)).reshape(2, -1)
    found = carried_over(plain, more, values, {"coupon_mode.mass_share": 0.7})
    assert more.nuisances[4] == "coupon_mode.mass_share"
    assert np.array_equal(found[:, 4], [0.7, 0.7])
    assert np.array_equal(np.delete(found, 4, axis=1), values)
    assert np.array_equal(carried_over(more, plain, found), values)
    assert fresh(more, 3)[:, 4] == pytest.approx(0.3)
