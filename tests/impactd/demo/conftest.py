"""A diagnosis and an HSD fit of one pair, small enough to see what becomes of each number."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from impactd.demo.outcome import Outcome, compare

Json = dict[str, Any]


def measurand(value: float, u: float) -> Json:
    """Return a modulus as the API states it."""
    return {"value": value, "u": u, "unit": "Pa", "interval95": [value - 2 * u, value + 2 * u]}


def block(model: str, factor: float, heldout_rms_v: float) -> Json:
    """Return what a model says whose moduli are the truth times a factor."""
    return {
        "model": model,
        "heldout_rms_V": heldout_rms_v,
        "pairs": {
            "ptfe/specimen": {
                "sphere": "ptfe",
                "surface": "specimen",
                "shots": 3,
                "reduced_modulus_Pa": measurand(0.25e9 * factor, 1e7),
            }
        },
        "moduli": {
            "ptfe": {
                "side": "sphere",
                "status": "reference",
                "youngs_modulus_Pa": measurand(0.4e9 * factor, 1e7),
                "plane_strain_modulus_Pa": measurand(0.5e9 * factor, 1e7),
            },
            "specimen": {
                "side": "surface",
                "status": "fitted",
                "youngs_modulus_Pa": None,
                "plane_strain_modulus_Pa": measurand(0.5e9 * factor, 1e7),
            },
        },
        "parameters": {"sensor.gain_N_per_V": {"value": 2.3, "u": 0.1}},
    }


def diagnosis(verdict: str, names: tuple[str, ...] = (), **more: Any) -> Json:
    """Return the part of a diagnosis that the demo reads."""
    before = block("kv2", 1.2, 5e-3)
    after = block("+".join(("kv2", *names)), 1.01, 1.5e-3) if verdict != "adequate" else before
    return {
        "verdict": verdict,
        "sentence": f"It is {verdict}.",
        "slot": "contact",
        "noise_rms_V": 1.5e-3,
        "before": before,
        "after": after,
        "effects": [
            {"id": name, "slot": "contact", "parameters": {}, "confusable_with": []}
            for name in names
        ],
        "residual": {"before": {"said": ["It is large."]}, "after": None},
        "campaign": {"shots": 3},
        "next_drop": None,
        **more,
    }


@pytest.fixture
def diagnosis_of() -> Callable[..., Json]:
    """Return what makes a diagnosis of a verdict and the names it gives."""
    return diagnosis


@pytest.fixture
def outcome_of() -> Callable[..., Outcome]:
    """Return what makes an outcome of a diagnosis and the ids that truly acted."""

    def make(found: Json, *hidden: str) -> Outcome:
        material = {"youngs_modulus_Pa": 0.4e9, "plane_strain_modulus_Pa": 0.5e9}
        truth = {
            "spheres": {"ptfe": material},
            "surfaces": {"specimen": material},
            "effects": [
                {"id": name, "slot": "contact", "parameters": {"size_m": 1.0}, "scope": {}}
                for name in hidden
            ],
        }
        run = {"number": 1, "drops": [1, 2], "result": None}
        fits = {"hsd": block("hsd", 1.6, 0.2), "kv": block("kv", 1.3, 8e-3)}
        return compare(fits, found, run, truth, seed=5)

    return make
