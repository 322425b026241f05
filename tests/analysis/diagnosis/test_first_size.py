"""Where a fit of one more effect begins: everything else has followed its size."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from analysis.diagnosis.basis.proposals import proposals, times_for
from analysis.diagnosis.linearised import linearise
from analysis.diagnosis.multistart import Start, starts
from analysis.diagnosis.successive_halving import FIRST_STEPS
from analysis.fit import joint
from analysis.fit.problem import JointProblem, build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

from .conftest import small_campaign

EFFECTS = {
    "stress_relaxation": {"strength": 0.03, "relaxation_time_s": 1.2e-5},
    "viscoelastic_damping": {"relaxation_s": 2e-7},
}


def gain_after(steps: int, problem: JointProblem, base: joint.Fitted, first: Start) -> float:
    """Return what a start explains after so many steps."""
    return first.fitted(problem, base, steps).gain


@pytest.mark.parametrize("effect", EFFECTS)
def test_a_start_explains_most_of_what_was_promised(tmp_path: Path, effect: str) -> None:
    """Before any step, where a size alone leaves the contact too stiff; a few steps end the fit."""
    campaign = small_campaign(tmp_path, effect, **EFFECTS[effect])
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    base = joint.fit(problem, nuisances)
    tried = [p for p in proposals(problem)[0] if p.effect_id == effect]
    first = next(
        s for s in starts(linearise(problem, base, tried), tried)[effect] if s.scope == "rig"
    )

    assert gain_after(0, problem, base, first) > 0.5 * first.promised
    whole = gain_after(60, problem, base, first)
    assert gain_after(8, problem, base, first) == pytest.approx(whole, rel=0.01)


def test_what_a_slow_amplifier_does_beside_its_delay_is_seen(tmp_path: Path) -> None:
    """Its derivative is a delay, which touch-down takes up: an echo would seem likelier."""
    campaign = small_campaign(tmp_path, "amplifier_lowpass", cutoff_hz=7.5e4, filter_order=2)
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    base = joint.fit(problem, nuisances)
    tried = [p for p in proposals(problem)[0] if p.effect_id in ("amplifier_lowpass", "echo")]
    found = starts(linearise(problem, base, tried), tried)
    assert next(iter(found)) == "amplifier_lowpass"
    assert found["amplifier_lowpass"][0].proposal.effect.id == "amplifier_lowpass:second_order"


@pytest.mark.parametrize(
    ("effect", "form", "numbers"),
    [
        ("amplifier_lowpass", "second_order", {"cutoff_hz": 9e4, "filter_order": 2}),
        ("surface_roughness", "toe", {"roughness_m": 8e-7}),
    ],
)
def test_what_grows_with_a_power_begins_at_a_size_that_does_as_much(
    tmp_path: Path, effect: str, form: str, numbers: dict[str, float]
) -> None:
    """In proportion to what is seen it would begin ten times too small."""
    campaign = small_campaign(tmp_path, effect, **numbers)
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    base = joint.fit(problem, nuisances)
    tried = [p for p in proposals(problem)[0] if p.effect_id == effect]
    found = starts(linearise(problem, base, tried), tried)[effect]
    first = next(s for s in found if s.scope == "rig")
    assert first.proposal.effect.id == f"{effect}:{form}"
    after_few, after_many = (gain_after(steps, problem, base, first) for steps in (FIRST_STEPS, 60))
    assert after_many > 60.0
    assert after_few > 0.9 * after_many
    # a size of the wrong sign promises nothing
    assert all(s.promised < 0.0 for s in found if all(v < 0.0 for v in s.coefficients.values()))


@pytest.mark.parametrize(
    ("share", "power", "times"),
    [(0.25, 2.0, 0.5), (4.0, -2.0, 0.5), (30.0, 1e-3, math.inf), (0.01, 1e-3, 0), (0.5, 0, 1)],
)
def test_a_share_of_what_grows_with_a_power(share: float, power: float, times: float) -> None:
    """What hardly grows is asked for at its limits, and what does not stays as it is."""
    assert times_for(share, power) == pytest.approx(times)
