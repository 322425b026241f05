"""Effects that records show by themselves, on pulses that no model of the project draws."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from analysis.campaign import Campaign, Shot
from analysis.diagnosis.document.wording import why_not
from analysis.diagnosis.model_free import Shown, shown_by_records
from analysis.diagnosis.multistart import usual_place
from analysis.diagnosis.procedure import Diagnosis, _judge, _shown
from analysis.diagnosis.progress import BudgetSpentError, TimeBudget, Watch
from analysis.diagnosis.selection import Selection, Step
from analysis.effects.library import effect_named
from analysis.fit import joint
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named
from impactd.storage.campaign_folder import load_campaign

Array = NDArray[np.float64]
Change = Callable[[Array, float, np.random.Generator], Array]

RATE_HZ, SAMPLES, TRIGGER = 100e3, 4000, 400
RECORDINGS = Path(__file__).parents[4] / "shared" / "data"
SETS = ("hammer", "repeated-shock", "drop-tower", "board-impacts")


def _campaign(seed: int, change: Change) -> Campaign:
    """Return nine hits of two humps, a dip and a ring, whose sizes and lengths differ."""
    rng = np.random.default_rng(seed)
    second, dip, ring = rng.uniform(0.0, 0.6), rng.uniform(0.0, 0.1), rng.uniform(0.0, 0.1)
    shots = []
    for number in range(9):
        t = (np.arange(SAMPLES) - TRIGGER) / RATE_HZ / rng.uniform(0.9, 1.1)
        wave = np.exp(-((t / 1e-4) ** 2)) + second * np.exp(-(((t - 2e-4) / 1e-4) ** 2))
        wave -= dip * np.exp(-(((t - 8e-4) / 2e-4) ** 2))
        wave += ring * np.where(t > 0, np.exp(-t / 1e-3) * np.sin(2 * np.pi * 4e3 * t), 0.0)
        signal = change(rng.uniform(0.6, 1.4) * wave, RATE_HZ, rng)
        signal = signal + rng.normal(0.0, 1e-3, SAMPLES) + rng.uniform(-0.1, 0.1)
        shots.append(Shot(f"hit {number}", signal, RATE_HZ, TRIGGER, quantity="force_N"))
    return Campaign(tuple(shots))


def untouched(x: Array, rate_hz: float, rng: np.random.Generator) -> Array:
    """Change nothing."""
    return x


def cut(share: float) -> Change:
    """Cut at so much of a typical peak."""
    return lambda x, rate_hz, rng: np.clip(x, -share, share)


def high_passed(tau_s: float) -> Change:
    """Pass through a coupler, by its difference equation."""

    def change(x: Array, rate_hz: float, rng: np.random.Generator) -> Array:
        pole = (2.0 * tau_s * rate_hz - 1.0) / (2.0 * tau_s * rate_hz + 1.0)
        gain = 0.5 * (1.0 + pole)
        return np.asarray(lfilter([gain, -gain], [1.0, -pole], x))

    return change


def humming(size: float, mains_hz: float) -> Change:
    """Add the mains at a phase of its own."""

    def change(x: Array, rate_hz: float, rng: np.random.Generator) -> Array:
        phase = rng.uniform(0.0, 2.0 * np.pi)
        return x + size * np.sin(2.0 * np.pi * mains_hz * np.arange(x.size) / rate_hz + phase)

    return change


def _seen(campaign: Campaign) -> dict[str, Shown]:
    found = shown_by_records(build(campaign, model_named("hsd")).shots)
    return {one.form: one for one in found}


@pytest.mark.parametrize("seed", range(12))
def test_each_is_seen_and_nothing_else(seed: int) -> None:
    """Of the size that was drawn, whatever the pulse looks like."""
    assert not _seen(_campaign(seed, untouched))
    rng = np.random.default_rng(seed)
    ceiling = float(rng.uniform(0.5, 0.8))
    found = _seen(_campaign(seed, cut(ceiling)))
    assert found.keys() == {"clipping"}
    assert found["clipping"].values["ceiling_v"] == pytest.approx(ceiling, rel=0.02)
    # the dips behind the pulse are taken for the coupler's, too
    tau_s = float(np.exp(rng.uniform(np.log(5e-4), np.log(5e-3))))
    found = _seen(_campaign(seed, high_passed(tau_s)))
    assert found.keys() == {"coupler_highpass"}
    assert found["coupler_highpass"].values["time_constant_s"] == pytest.approx(tau_s, rel=0.25)
    mains_hz = float(rng.choice([50.0, 60.0]))
    found = _seen(_campaign(seed, humming(float(rng.uniform(0.01, 0.05)), mains_hz)))
    assert found.keys() == {"mains_hum" if mains_hz == 50.0 else "mains_hum:60_hz"}


def test_hits_alike_to_the_last_bit_show_no_ceiling() -> None:
    """Tops of one height are no wonder where everything else is alike, too."""
    campaign = _campaign(3, cut(0.7))
    shots = tuple(dataclasses.replace(campaign.shots[0], name=str(i)) for i in range(9))
    assert "clipping" not in _seen(dataclasses.replace(campaign, shots=shots))


def test_two_hits_show_nothing() -> None:
    """Chance is not told from a law."""
    campaign = _campaign(3, cut(0.7))
    assert not _seen(dataclasses.replace(campaign, shots=campaign.shots[:2]))


def test_what_is_shown_is_held_where_the_model_is_wrong() -> None:
    """The contact's law does not fit; the coupler's time constant is the records' all the same."""
    problem, nuisances = with_start(build(_campaign(5, high_passed(1e-3)), model_named("hsd")))
    fitted = joint.fit(problem, nuisances)
    selection, shown = _shown(
        Selection([Step(problem, fitted)], []), usual_place(problem, fitted.nuisances)
    )
    assert [one.effect_id for one in selection.chosen] == ["coupler_highpass"]
    assert len(shown) == 1
    found = selection.chosen[0]
    assert found.gain > 0.0
    at = found.problem.names.index("coupler_highpass.time_constant_s")
    tau_s = found.effect.parameters[0].value(float(found.fitted.theta[at]))
    assert tau_s == pytest.approx(shown[0].values["time_constant_s"], rel=1e-2)
    assert tau_s == pytest.approx(1e-3, rel=0.25)


def test_no_candidate_is_said_to_fall_short_of_what_records_show_alone() -> None:
    """No fit was compared with it: one that follows the records better has another reason."""
    problem, nuisances = with_start(build(_campaign(5, high_passed(1e-3)), model_named("hsd")))
    fitted = joint.fit(problem, nuisances)
    first = Step(problem, fitted)
    selection, shown = _shown(Selection([first], []), usual_place(problem, fitted.nuisances))
    taken = selection.chosen[0]
    closer = {"effect_id": "echo", "effect": effect_named("echo"), "gain": 10.0 * taken.gain}
    rival = dataclasses.replace(taken, at_bound=False, **closer)
    first.refits = [rival]
    diagnosis = Diagnosis("partial", selection.steps, selection.chosen, shown=tuple(shown))
    told = why_not(diagnosis, first, rival)
    assert told is not None
    assert told.endswith("what remains is still structured")


def test_what_is_shown_is_told_although_the_time_is_over() -> None:
    """No model comes near; a search that is cut short raises nothing and takes nothing away."""
    watch = Watch(budget=TimeBudget(1.0, iter(range(0, 10**6, 100)).__next__))
    problem, nuisances = with_start(build(_campaign(5, cut(0.7)), model_named("hsd")))
    fitted = joint.fit(problem, nuisances)
    selection = Selection([Step(problem, fitted)], [])
    selection.last.problem = watch.over(problem)
    with pytest.raises(BudgetSpentError):
        watch.check()
    found = _judge(selection, selection, usual_place(problem, fitted.nuisances), watch)
    assert found.verdict == "partial"
    assert found.effect_ids == ["clipping"]
    with pytest.raises(BudgetSpentError):  # what is learned on top of it ends with the time
        found.steps[-1].problem.checkpoint()


@pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the shared recordings are not here")
@pytest.mark.parametrize("name", SETS)
def test_on_others_recordings(name: str) -> None:
    """Nothing as they are; what is put in is seen, hum where a record holds a period of it."""
    campaign = load_campaign(RECORDINGS / name)

    def changed(change: Change) -> dict[str, Shown]:
        rng = np.random.default_rng(1)
        shots = []
        for shot in campaign.shots:
            rest = float(np.median(shot.signal[: max(5, shot.trigger_index // 2)]))
            signal = change((shot.signal - rest) / peak, shot.sample_rate_hz, rng)
            shots.append(dataclasses.replace(shot, signal=peak * signal + rest))
        return _seen(dataclasses.replace(campaign, shots=tuple(shots)))

    peak = float(np.median([np.abs(shot.signal).max() for shot in campaign.shots]))
    assert not changed(untouched)
    assert changed(cut(0.6)).keys() == {"clipping"}
    assert changed(high_passed(1e-3)).keys() == {"coupler_highpass"}
    shot = campaign.shots[0]
    periods = 50.0 * shot.signal.size / shot.sample_rate_hz
    assert changed(humming(0.03, 50.0)).keys() == ({"mains_hum"} if periods > 1.0 else set())
