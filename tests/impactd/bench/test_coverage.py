"""The coverage benchmark draws, fits and counts what it says."""

from __future__ import annotations

import dataclasses
import math

import pytest

from drivers.simulated.label_spread import EXACT, TYPICAL
from drivers.simulated.rig_model import DEFAULT_RIG
from impactd.bench.coverage import (
    REFERENCE,
    Pull,
    Rigs,
    campaign_pulls,
    coverage,
    draw_settings,
    table,
)


def _pull(campaign: int, score: float) -> Pull:
    return Pull("joint", "white", "E* of a pair", campaign, "a/b", score, 0.01)


def test_an_interval_holds_the_truth_within_its_own_factor() -> None:
    """A score of 1.5 is outside the 68 % interval and inside the 95 % one."""
    pulls = [_pull(1, 0.5), _pull(2, -1.5), _pull(3, 2.5), _pull(4, 0.0)]
    assert coverage(pulls, "68")[0] == 0.5
    assert coverage(pulls, "95")[0] == 0.75


def test_quantities_of_one_campaign_do_not_count_as_independent() -> None:
    """Ten copies of each campaign's interval leave the chance of the share as it was."""
    once = [_pull(i, 3.0 * (i % 2)) for i in range(10)]
    _, alone = coverage(once, "95")
    _, copied = coverage(once * 10, "95")
    assert copied == pytest.approx(alone)


def test_campaigns_differ_in_everything_and_have_a_reference_and_a_specimen() -> None:
    """Even seeds are white, odd ones coloured; each has the surfaces that both ways need."""
    drawn = [draw_settings(seed) for seed in range(8)]
    assert len({d.drop_heights_m for d in drawn}) == 8
    assert len({tuple(d.spheres) for d in drawn}) > 2
    for seed, settings in enumerate(drawn):
        assert (settings.noise.ar1 > 0) == bool(seed % 2)
        assert {REFERENCE, "specimen"} < set(settings.surfaces)


def test_rigs_are_as_labelled_unless_asked_for() -> None:
    """Old seeds repeat; with labels that are off, only what is true of the rig changes."""
    assert draw_settings(5) == draw_settings(5, Rigs())
    off = draw_settings(5, Rigs("closed", "typical", states_u=False))
    assert (off.rig, off.spread, off.states_u) == ("closed", TYPICAL, False)
    assert dataclasses.replace(off, rig=DEFAULT_RIG, spread=EXACT, states_u=True) == (
        draw_settings(5)
    )


def test_one_campaign_gives_every_quantity_in_both_ways() -> None:
    """Scores are a few standard uncertainties at most, and every sort of quantity is there."""
    pulls = campaign_pulls(3001)
    for way, extra in (("joint", set()), ("archive", {"E* of one shot"})):
        kinds = {p.kind for p in pulls if p.way == way}
        moduli = {f"{e} of {x}" for e in ("E", "E/(1-nu^2)") for x in ("specimen", "a reference")}
        wanted = {"E* of a pair", "S", "f0", "zeta", "M"} | moduli
        assert kinds == wanted | extra
    assert all(math.isfinite(p.score) and abs(p.score) < 5 for p in pulls)
    assert "| joint | E of specimen | 1 |" in table(pulls)
