"""Earlier effects are asked again beside later ones."""

from __future__ import annotations

import dataclasses

import pytest

from analysis.diagnosis import backward_elimination
from analysis.diagnosis.backward_elimination import revised, steps_in_order, without_needless
from analysis.diagnosis.basis.proposals import rescoped
from analysis.diagnosis.candidate import Refit, extended, refitted
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.selection import Selection, Step
from analysis.effects.acts_on import ActsOn
from analysis.effects.effect import Effect
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from analysis.parameters import of_effect
from drivers.simulated.effects import Scope, make_effect

from .conftest import campaign_with

CUTOFF_HZ = 3e4
LOSS_S_PER_M = 0.05


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Selection:
    """The base model, on records of a first-order amplifier and of a loss on one surface."""
    lossy = make_effect(
        "hunt_crossley_damping",
        {"damping_s_per_m": LOSS_S_PER_M},
        scope=Scope(surface="specimen"),
    )
    slow = make_effect("amplifier_lowpass", {"cutoff_hz": CUTOFF_HZ, "filter_order": 1.0})
    campaign = campaign_with(tmp_path_factory.mktemp("both"), (slow, lossy), "closed", 5)
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    return Selection([Step(problem, joint.fit(problem, nuisances))], [])


def _with(selection: Selection, effect: Effect, value: float, group: str = "") -> Selection:
    """Return a selection with one effect more, fitted from a value of its one number."""
    step, (number,) = selection.last, effect.parameters
    start = {of_effect(effect.id, number.name, group): number.coordinate(value)}
    larger, theta, nuisances = extended(step.problem, step.fitted, effect, start)
    fitted = joint.fit(larger, nuisances, theta=theta)
    scope = effect.only.kind if effect.only else "rig"
    bare = Refit(
        effect, effect.id.partition(":")[0], scope, larger, fitted, 0.0, 0, at_bound=False,
        linear_gain=0.0,
    )  # fmt: skip
    taken = refitted(bare, step.problem, step.fitted)
    return Selection([*selection.steps, Step(larger, fitted)], [*selection.chosen, taken])


def test_the_form_of_the_first_effect_is_asked_again_beside_the_second(base: Selection) -> None:
    """Alone, a Bessel filter took up a part of the loss; beside the loss it is of first order."""
    loss = effect_named("hunt_crossley_damping")
    loss = dataclasses.replace(rescoped(loss, "rig"), only=ActsOn("surface", ("specimen",)))
    wrong = _with(base, effect_named("amplifier_lowpass:bessel"), 2.0 * CUTOFF_HZ)
    both = _with(wrong, loss, LOSS_S_PER_M, "specimen")
    assert not both.adequate

    found = revised(both)
    assert found.adequate
    assert {c.effect.id for c in found.chosen} == {"amplifier_lowpass", "hunt_crossley_damping"}
    assert found.last.fitted.cost < both.last.fitted.cost


def test_a_name_of_another_slot_that_explained_much_is_asked_beside_the_second(
    base: Selection,
) -> None:
    """What the second effect explains may have decided which came first."""
    slow = rescoped(effect_named("amplifier_lowpass"), "rig")
    taken = _with(base, slow, CUTOFF_HZ).chosen[-1]
    others = [
        dataclasses.replace(
            taken, effect=effect_named(name), effect_id=name, gain=share * taken.gain
        )
        for name, share in (("base_compliance", 0.9), ("plate_radiation", 0.1))
    ]
    turn = dataclasses.replace(base.last, refits=[taken, *others])
    asked = backward_elimination._could_stand_in(turn, taken)
    assert {"base_compliance", "echo", "coupler_highpass"} <= asked
    assert "plate_radiation" not in asked


def test_the_grouping_of_the_first_effect_is_asked_again_beside_the_second(base: Selection) -> None:
    """Alone, the loss seemed to be everybody's; beside the filter it is one surface's."""
    wrong = _with(base, rescoped(effect_named("hunt_crossley_damping"), "rig"), LOSS_S_PER_M)
    both = _with(wrong, effect_named("amplifier_lowpass"), CUTOFF_HZ)
    assert not both.adequate

    found = revised(both)
    assert found.adequate
    loss = next(c.effect for c in found.chosen if c.effect_id == "hunt_crossley_damping")
    assert loss.only is not None or {p.scope for p in loss.parameters} == {"surface"}


def test_an_effect_goes_where_the_others_leave_noise_without_it(
    base: Selection, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However many squares it takes: the error of another's law may give it some."""
    loss = effect_named("hunt_crossley_damping")
    loss = dataclasses.replace(rescoped(loss, "rig"), only=ActsOn("surface", ("specimen",)))
    slow = _with(base, effect_named("amplifier_lowpass"), CUTOFF_HZ)
    both = _with(slow, loss, LOSS_S_PER_M, "specimen")
    three = _with(both, effect_named("sensor_nonlinearity"), 1e-3)
    assert both.adequate

    ever_ahead = dataclasses.replace(CRITERIA, least_lead=-1e9)
    monkeypatch.setattr(backward_elimination, "CRITERIA", ever_ahead)
    left = {c.effect_id for c in without_needless(three).chosen}
    assert left == {"amplifier_lowpass", "hunt_crossley_damping"}


def test_an_earlier_step_with_the_effects_of_an_old_order_is_fitted_again(base: Selection) -> None:
    """The first of three steps has the effect that was chosen second."""
    slow, loss = effect_named("amplifier_lowpass"), effect_named("hunt_crossley_damping")
    two = _with(_with(base, slow, CUTOFF_HZ), rescoped(loss, "rig"), LOSS_S_PER_M)
    three = _with(two, effect_named("sensor_nonlinearity"), 1e-4)
    old = _with(base, rescoped(loss, "rig"), LOSS_S_PER_M).last
    start, first, *rest = steps_in_order(
        Selection([three.steps[0], old, *three.steps[2:]], three.chosen)
    )
    assert [e.id for e in first.problem.model.effects] == ["amplifier_lowpass"]
    assert first.fitted.cost == pytest.approx(three.steps[1].fitted.cost, rel=1e-6)
    assert [start, *rest] == [three.steps[0], *three.steps[2:]]
    assert steps_in_order(three) == three.steps
