"""A jump of the clock and a late impact are found, wherever they lie in a record."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.signal import lsim

from analysis.diagnosis.basis.time_course import (
    WIDTHS_US,
    jump_columns,
    late_impact_columns,
    late_impact_shape,
    late_impact_width,
)
from analysis.diagnosis.discrepancy.fit import learn
from analysis.fit import joint
from analysis.fit.campaign_fit import heldout_rms
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

from .conftest import small_campaign

RATE = 1e6
CRYSTAL = (2.0 * math.pi * 17.8e3, 0.074)


def _records(width_us: float, places: list[int], seed: int) -> tuple[list, list]:
    """Return blows of different sizes under noise of a twentieth, and the blows alone."""
    rng = np.random.default_rng(seed)
    shape = late_impact_shape(width_us, RATE, CRYSTAL)
    blows = []
    for place in places:
        late_impact = np.zeros(3000)
        seen = min(shape.size, late_impact.size - place)
        late_impact[place : place + seen] = rng.uniform(0.5, 2.0) * shape[:seen]
        blows.append(late_impact)
    return [b + 0.05 * rng.standard_normal(b.size) for b in blows], blows


@pytest.mark.parametrize("width_us", [20.0, 150.0])
def test_a_crystal_answers_a_bell_as_its_equation_says(width_us):
    """Integrated on its own: x'' + 2 z w x' + w^2 x = w^2 F."""
    w, z = CRYSTAL
    shape = late_impact_shape(width_us, RATE, CRYSTAL)
    fine = np.arange(20 * shape.size) / (20 * RATE)
    share = fine * 1e6 / width_us
    force = np.where(share < 1.0, 0.5 - 0.5 * np.cos(2.0 * math.pi * share), 0.0)
    _, answer, _ = lsim(([w**2], [1.0, 2.0 * z * w, w**2]), force, fine)
    # half a sample later: a late impact's place is looked for anyway
    np.testing.assert_allclose(shape, answer[10::20], atol=0.01 * np.max(answer))


def test_a_rigid_cell_reads_the_force_itself():
    """And nothing after it."""
    shape = late_impact_shape(100.0, RATE, None)
    assert np.max(shape[:100]) == pytest.approx(1.0, abs=1e-3)
    assert not np.any(shape[100:])


@pytest.mark.parametrize("width_us", [WIDTHS_US[8], WIDTHS_US[32]])
def test_width_and_place_of_blows_are_found(width_us):
    """Each shot has its own place and size; the width is one."""
    records, blows = _records(width_us, [400, 911, 1620], seed=5)
    found = late_impact_width(records, [200] * 3, [RATE] * 3, [CRYSTAL] * 3)
    assert found == width_us
    shape = late_impact_shape(found, RATE, CRYSTAL)
    for record, late_impact in zip(records, blows, strict=True):
        labels, columns = late_impact_columns(record, 200, RATE, shape, 0.1)
        assert len(labels) == columns.shape[1]
        sizes = np.linalg.lstsq(columns, record, rcond=None)[0]
        assert np.std(late_impact - columns @ sizes) < 0.01


def test_a_place_between_two_samples_is_taken_up():
    """By the second column, to a hundredth of what the nearest sample leaves or better."""
    coarse = late_impact_shape(100.0, RATE, CRYSTAL)
    t = np.arange(3000.0)
    late_impact = np.interp(t - 0.4, np.arange(coarse.size) + 800, coarse, left=0.0, right=0.0)
    _, columns = late_impact_columns(late_impact, 200, RATE, coarse, 0.1)

    def left(some: np.ndarray) -> float:
        sizes = np.linalg.lstsq(some, late_impact, rcond=None)[0]
        return float(np.sum((late_impact - some @ sizes) ** 2))

    assert left(columns) < 0.02 * left(columns[:, :1])


def test_what_the_record_cuts_off_is_no_blow():
    """At least half of it must be seen: one that begins 100 samples before the end is not taken."""
    (record,), _ = _records(400.0, [2900], seed=6)
    shape = late_impact_shape(400.0, RATE, CRYSTAL)
    _, columns = late_impact_columns(record, 200, RATE, shape, 0.1)
    assert np.flatnonzero(columns[:, 0])[0] < 2850


def test_a_blow_at_a_time_of_its_own_in_every_shot_is_learned(tmp_path):
    """A cell that hops: the error on held-out shots falls at least threefold."""
    campaign = small_campaign(tmp_path, "x_hopping_cell", share=0.05, hop_s=5e-4)
    problem, nuisances = with_start(build(campaign, model_named("kv2")))
    fitted = joint.fit(problem, nuisances)
    before = heldout_rms(problem, fitted)
    learned = learn(problem, fitted, [("blow", "shot")])
    assert learned.heldout_rms < before / 3


def _ring(samples):
    """A pulse that sets off a ring, at any time."""
    t = np.asarray(samples) * 1e-6
    later = np.maximum(t - 1e-4, 0.0)
    ring = 0.4 * np.exp(-later / 3e-4) * np.sin(1.6e5 * later)
    return np.exp(-(((t - 1e-4) / 3e-5) ** 2)) + ring


@pytest.mark.parametrize(("lost", "at", "late"), [(3, 160, 1), (-5, 240, -3), (1, 130, 0.5)])
def test_the_jump_of_a_record_that_lost_samples_is_found(lost, at, late):
    """The model's touch-down lies between: late before the jump, early after it."""
    n = np.arange(700)
    noise = 1e-3 * np.random.default_rng(5).standard_normal(n.size)
    record = _ring(n + np.where(n < at, 0.0, lost)) + noise
    model = _ring(n + late)
    labels, columns = jump_columns(model, record - model, first=40)
    assert (len(labels), columns.shape) == (1, (700, 1))
    came = int(np.argmax(columns[:, 0] != 0.0))
    assert came == pytest.approx(at, abs=3)
    in_time, jump = _ring(n), columns[:, 0] * lost
    left = record - in_time - jump
    assert np.std(left[n > at + 3]) < 0.2 * np.std((record - in_time)[n > at + 3])


def test_a_record_without_a_jump_has_a_column_that_explains_no_more_than_chance():
    """Place and size are free: some tens of whitened squares, not hundreds."""
    n = np.arange(700)
    rng = np.random.default_rng(6)
    for _ in range(20):
        noise = 1e-3 * rng.standard_normal(n.size)
        column = jump_columns(_ring(n), noise, first=40)[1][:, 0]
        size = column @ noise / max(column @ column, 1e-300)
        assert (size * column @ noise) / 1e-6 < 40.0
