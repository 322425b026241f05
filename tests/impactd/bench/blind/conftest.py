"""Trials as a diagnosis would have left them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from impactd.bench.blind.trial import Trial

MISTAKES_MADE: dict[str, dict[str, Any]] = {
    "wrong_mass": {"scope": {"sphere": "acetal"}, "numbers": {"factor": 1.03}},
    "wrong_radius": {"scope": {"sphere": "acetal"}, "numbers": {"factor": 1.04}},
    "wrong_height": {
        "scope": {"drop_height_m": 0.027},
        "numbers": {"factor": 1.2, "drop_height_m": 0.0225},
    },
    "wrong_label": {"scope": {"shot": 17}, "numbers": {}, "label": {"sphere": "hdpe"}},
    "odd_shot": {"scope": {"shot": 5}, "numbers": {"factor": 0.9}},
    "coupon_exchanged": {
        "scope": {"surface": "specimen"},
        "numbers": {"factor": 1.1, "first_shot": 24, "last_before": 20},
    },
    "gain_switched": {
        "scope": {"cell": "gain"},
        "numbers": {"factor": 1.02, "first_shot": 30, "last_before": 29},
    },
    "drift_in_time": {"scope": {"cell": "gain"}, "numbers": {"relative_change": 0.02}},
}


@pytest.fixture
def a_trial() -> Callable[..., Trial]:
    """Return a function that makes a trial from what acted and what was said."""

    def make(*truth: str, **said: Any) -> Trial:
        """Return a trial in which something acted and something was said."""
        row: dict[str, Any] = {
            "kind": "library",
            "seed": 1,
            "base": "kv2",
            "rig": "closed",
            "effects": [{"id": name, "slot": "electronics"} for name in truth],
            "materials": [],
            "colour": "white",
            "ar1": 0.0,
            "noise_true_V": 1e-3,
            "verdict": "identified",
        }
        return Trial.from_json(row | said)

    return make


@pytest.fixture
def a_mistake() -> Callable[..., Trial]:
    """Return a function that makes a trial from a mistake and what was said."""

    def make(mistake_id: str, **said: Any) -> Trial:
        """Return a trial in which people did something wrong and something was said."""
        row: dict[str, Any] = {
            "kind": "mistake",
            "seed": 1,
            "base": "kv2",
            "rig": "closed",
            "effects": [],
            "mistake": {"id": mistake_id, "label": {}} | MISTAKES_MADE[mistake_id],
            "materials": [],
            "colour": "white",
            "ar1": 0.0,
            "noise_true_V": 1e-3,
            "verdict": "identified" if said.get("named") else "adequate",
            "visible": 1e4,
            "visible_each": [1e4],
        }
        return Trial.from_json(row | said)

    return make
