"""The linearisation answers about any fit, one that has gone astray included."""

from __future__ import annotations

import dataclasses

import numpy as np

from analysis.diagnosis.linearised import linearise


def _copied(linearised, family, size):
    """The linearisation with a family's columns all the same one, so many times as large."""
    at, _ = linearised.families[family]
    shots = []
    for shot in linearised.shots:
        turn = np.eye(shot.vector.size)
        turn[:, at] = 0.0
        turn[at[0], at] = size
        shots.append(
            dataclasses.replace(
                shot, matrix=turn.T @ shot.matrix @ turn, vector=turn.T @ shot.vector
            )
        )
    return dataclasses.replace(linearised, shots=shots)


def test_columns_that_a_lost_fit_has_blown_up_are_one_column(leaky):
    """Three like columns of 1e21 leave no ridge, and are worth what one of them is."""
    first = leaky.steps[0]
    linearised = linearise(first.problem, first.fitted, wanted=["cell"])
    one = _copied(linearised, "cell", 1.0).explain("cell", "rig", heldout=False)
    lost = _copied(linearised, "cell", 1e21).explain("cell", "rig", heldout=False)
    assert lost.dof == one.dof == 1
    np.testing.assert_allclose(lost.gain, one.gain, rtol=1e-6)


def test_a_pulse_outside_its_window_says_nothing(leaky):
    """A lost fit may put a touch-down behind the last sample: no own number has an effect there."""
    first = leaky.steps[0]
    nuisances = first.fitted.nuisances.copy()
    nuisances[0, first.problem.model.nuisances.index("t0_us")] = 1e5
    lost = dataclasses.replace(first.fitted, nuisances=nuisances)
    linearised = linearise(first.problem, lost, wanted=["cell"])
    assert np.isfinite(linearised.explain("cell", "rig", heldout=False).gain)


def test_a_power_of_a_contact_that_hardly_is_one_says_nothing(leaky):
    """A lost fit may leave most shots without speed: what is small there is huge in the others."""
    first = leaky.steps[0]
    nuisances = first.fitted.nuisances.copy()
    nuisances[1:, first.problem.model.nuisances.index("ln_v0")] = -16.0
    lost = dataclasses.replace(first.fitted, nuisances=nuisances)
    linearised = linearise(first.problem, lost, wanted=["contact"])
    own = (
        linearised.shots[0].item.window.signal.max() ** 2 / linearised.shots[0].item.noise.rms ** 2
    )
    at, _ = linearised.families["contact"]
    assert np.diag(linearised.shots[0].matrix)[at].max() < 1e6 * own
