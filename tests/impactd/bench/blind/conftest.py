"""Trials as a diagnosis would have left them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from impactd.bench.blind.trial import Trial


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
