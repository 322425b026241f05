"""How far an effect shows, in whitened squares, by the simulator's own account.

The same campaign is simulated with hardly any noise, with its effects and without. The base model
is fitted to both under the noise that the real campaign has; what the effects add to the cost at
the minimum is the squared length of what they leave behind, in units of noise. Priors are part of
the cost: an effect of the release shows only as speeds that contradict their heights.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from analysis.campaign import Campaign
from analysis.fit import joint
from analysis.fit.fit_shot import noise_by_instrument, usable_shots
from analysis.fit.problem import build
from analysis.fit.start import prepare
from analysis.model.impact_model import model_named
from drivers.simulated.effects import Effect
from impactd.bench.blind.plan import Plan
from impactd.bench.simulated_campaign import simulated_campaign

VISIBLE = 400.0
"""Whitened squares from which an effect counts as detectable: a residual of 20 in norm."""
QUIET = 0.1
"""Share of the noise that is left: enough to keep the converter's steps from lining up."""


@dataclasses.dataclass(frozen=True)
class Visibility:
    """What effects add to the whitened squares of the base model's best fit.

    Attributes
    ----------
    together : float
        All that act. [1]
    each : list of float
        One alone, in the order of the effects. [1]
    """

    together: float
    each: list[float]


def visibility(plan: Plan, campaign: Campaign) -> Visibility | None:
    """Return how far a trial's effects show.

    Parameters
    ----------
    plan : Plan
        Of the trial.
    campaign : Campaign
        As it was recorded; only its noise is used.

    Returns
    -------
    Visibility or None
        For the base ``hsd`` what the missing crystal leaves. None where nothing acts, or where the
        base model cannot be evaluated on the records at all.
    """
    if plan.base == "hsd":
        costs = [_cost(plan, campaign, (), model) for model in ("hsd", "kv")]
        return None if None in costs else Visibility(_less(*costs), [])
    effects = plan.effects
    if not effects:
        return None
    bare = _cost(plan, campaign, (), "kv")
    together = _cost(plan, campaign, effects, "kv")
    each = [together] if len(effects) == 1 else [_cost(plan, campaign, (e,), "kv") for e in effects]
    if bare is None or together is None or None in each:
        return None
    return Visibility(_less(together, bare), [_less(one, bare) for one in each])


def _less(cost: float | None, bare: float | None) -> float:
    assert cost is not None
    assert bare is not None
    return cost - bare


def _cost(plan: Plan, campaign: Campaign, effects: Sequence[Effect], model: str) -> float | None:
    """Return the cost of a quiet twin under the noise of the campaign."""
    quiet = dataclasses.replace(plan.settings.noise, rms_v=QUIET * plan.settings.noise.rms_v)
    settings = dataclasses.replace(plan.settings, effects=tuple(effects), noise=quiet)
    twin = _without_restitution(simulated_campaign(settings, plan.campaign_seed))
    problem = build(twin, model_named(model))
    noise = noise_by_instrument(tuple(usable_shots(campaign)[0]))
    problem.shots = [
        dataclasses.replace(s, noise=noise[s.shot.quantity, s.shot.sample_rate_hz])
        for s in problem.shots
    ]
    fitted = joint.fit(problem, prepare(problem))
    return fitted.cost if fitted.blocks else None


def _without_restitution(campaign: Campaign) -> Campaign:
    """Return what the loop looks at: stated rebounds are left out there."""
    shots = tuple(dataclasses.replace(s, restitution=None) for s in campaign.shots)
    return dataclasses.replace(campaign, shots=shots)
