"""The size of an effect or a mistake in whitened squares, from the simulator alone.

The same campaign is simulated with hardly any noise, with its effects or its mistake and without.
The base model is fitted to both under the noise that the real campaign has; what they add to the
cost at the minimum is the squared length of what they leave behind, in units of noise. Priors are
part of the cost: an effect of the release shows only as speeds that contradict their heights, and
a number written down wrong only as far as it contradicts its stated uncertainty.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from analysis.campaign import Campaign
from analysis.errors import AnalysisError
from analysis.fit import joint
from analysis.fit.fit_shot import noise_by_instrument, under_noise, usable_shots
from analysis.fit.freed_inputs import with_inputs
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from drivers.simulated.effects import Effect
from drivers.simulated.mistakes import Mistake, make_mistake
from impactd.bench.blind.plan import Plan
from impactd.bench.simulated_campaign import simulated_campaign, through_a_folder

VISIBLE = 400.0
"""Whitened squares from which an effect counts as detectable: a residual of 20 in norm."""
QUIET = 0.1
"""Share of the noise that is left: enough to keep the converter's steps from lining up."""


WRONG_NUMBERS = ("wrong_mass", "wrong_radius", "wrong_height")
"""Mistakes in what is stated with an uncertainty. Where such numbers counted as exact, the error of
a careful label would already leave hundreds of squares, and a mistake could even take them away."""


@dataclasses.dataclass(frozen=True)
class Visibility:
    """What effects or a mistake add to the whitened squares of the base model's best fit.

    Attributes
    ----------
    together : float
        All that act. [1]
    each : list of float
        One alone, in the order of the effects; a mistake's by itself. [1]
    """

    together: float
    each: list[float]


def visibility(plan: Plan, campaign: Campaign) -> Visibility | None:
    """Return how far a trial's effects or its mistake show.

    Parameters
    ----------
    campaign : Campaign
        As it was recorded; only its noise is used.

    Returns
    -------
    Visibility or None
        For the base ``hsd`` what the missing crystal leaves. None where nothing acts. Where the
        base model cannot be fitted at all, the difference of the records stands in: such effects
        are large, and must not drop out of the count.
    """
    if not plan.effects and plan.mistake is None and plan.base == plan.whole:
        return None
    bare_twin = _twin(plan, ())
    uncertain = plan.mistake is not None and plan.mistake.id in WRONG_NUMBERS
    bare = _cost(bare_twin, campaign, plan.whole, uncertain=uncertain)
    if plan.base == "hsd":
        return Visibility(_cost(bare_twin, campaign, "hsd") - bare, [])

    def added(effects: Sequence[Effect]) -> float:
        """Return what some effects and the mistake add to the cost."""
        twin = _twin(plan, effects, plan.mistake)
        try:
            return _cost(twin, campaign, plan.whole, uncertain=uncertain) - bare
        except (AnalysisError, np.linalg.LinAlgError):
            return _difference(twin, bare_twin, plan.settings.noise.rms_v)

    together = added(plan.effects)
    alone = [together] if len(plan.effects) <= 1 else [added([e]) for e in plan.effects]
    return Visibility(together, alone)


def _twin(plan: Plan, effects: Sequence[Effect], mistake: Mistake | None = None) -> Campaign:
    """Return the campaign with hardly any noise, other effects and no mistake or this one."""
    quiet = dataclasses.replace(plan.settings.noise, rms_v=QUIET * plan.settings.noise.rms_v)
    # steps of a coarse converter would stand above so little noise, and be taken for the effect
    settings = dataclasses.replace(plan.settings, effects=tuple(effects), noise=quiet, bits=16)
    if mistake is None:
        return _without_restitution(simulated_campaign(settings, plan.campaign_seed))
    made = make_mistake(settings, plan.campaign_seed, mistake)
    return _without_restitution(through_a_folder(made))


def _difference(twin: Campaign, bare: Campaign, noise_v: float) -> float:
    """Return by how much two campaigns differ before any fit, in squares of the noise."""
    pairs = zip(twin.shots, bare.shots, strict=True)
    return sum(float(np.sum((a.signal - b.signal) ** 2)) for a, b in pairs) / noise_v**2


def _cost(twin: Campaign, campaign: Campaign, model: str, *, uncertain: bool = False) -> float:
    """Return the cost of the low-noise copy under the noise of the campaign.

    ``uncertain`` takes masses, radii and the like as uncertain as stated, else as exact.
    """
    problem = build(twin, model_named(model))
    noise = noise_by_instrument(tuple(usable_shots(campaign)[0]))
    problem.shots = [
        under_noise(s, noise[s.shot.quantity, s.shot.sample_rate_hz]) for s in problem.shots
    ]
    problem, nuisances = with_start(problem)
    fitted = joint.fit(problem, nuisances)
    if fitted.failed:
        raise AnalysisError("The base model cannot be evaluated on these records.")
    if not uncertain:
        return fitted.cost
    problem = with_inputs(problem)
    stated = problem.start[fitted.theta.size :]
    return joint.fit(problem, fitted.nuisances, theta=np.concatenate([fitted.theta, stated])).cost


def _without_restitution(campaign: Campaign) -> Campaign:
    """Return the campaign as a diagnosis uses it, without stated rebounds."""
    shots = tuple(dataclasses.replace(s, restitution=None) for s in campaign.shots)
    return dataclasses.replace(campaign, shots=shots)
