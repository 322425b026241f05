"""Whole blind trials whose answer was wrong once."""

from __future__ import annotations

import pytest

from impactd.bench.blind.trial import run_trial


def test_a_shot_with_a_wrong_label_is_not_taken_for_a_rig_without_a_law() -> None:
    """Among a few shots one with a wrong name bends the fit as another law of mechanics would."""
    found = run_trial("mistake", 26_000_020)
    assert found.mistake is not None
    assert (found.mistake["id"], found.mistake["scope"]) == ("wrong_label", {"shot": 8})
    assert (found.verdict, found.set_aside) == ("adequate", [8])


@pytest.mark.slow
def test_a_third_name_must_leave_noise_of_all_shots_by_its_written_laws() -> None:
    """On a part of the shots a mode of the coupon stood beside the two effects that act."""
    found = run_trial("pair", 26_000_066)
    assert found.error is None
    assert set(found.named) == {"clipping", "sensor_nonlinearity"}
