"""Drift between calibrations: what both share cancels, what each has of its own does not."""

from __future__ import annotations

import dataclasses
import json
import math
from typing import Any

import numpy as np
import pytest

from analysis import calibrate, drift
from analysis.campaign import Campaign, Quantity
from analysis.cell_drift import drift_series

KNOWN = (("acetal", "polycarbonate"), ("hdpe", "polycarbonate"))
LABELS = ("gain_N_per_V", "natural_frequency_Hz", "damping_ratio")


@pytest.fixture(scope="module")
def run(truth: Any) -> Any:
    """Return a maker of calibrations of one cell with one set of references and certificate."""
    stated = truth(seed=61).campaign(pairs=(), unknown=())

    def make(seed: int, *, gain: float = 1.0, stiffness: float = 1.0, **changed: Any) -> Any:
        rig = truth(seed=seed)
        # S = k c: the made recordings keep c, so a change of k at fixed M moves gain and ring
        rig.cell["crystal_stiffness"] *= stiffness
        shots = rig.campaign(pairs=KNOWN, unknown=(), heights_m=(0.015, 0.04)).shots
        shots = tuple(dataclasses.replace(s, signal=s.signal / gain) for s in shots)
        return calibrate(dataclasses.replace(stated, shots=shots, **changed), "kv").to_json()

    make.stated = stated  # type: ignore[attr-defined]
    return make


def test_common_uncertainty_cancels(run: Any) -> None:
    """The change of the gain is known better than either gain, whose references are the same."""
    one, two = run(1), run(2)
    found = drift(one, two)
    for label in LABELS:
        whole = math.hypot(
            *(x["identifiable"][label]["u"] / x["identifiable"][label]["value"] for x in (one, two))
        )
        assert found["combinations"][label]["common_cancels"]
        assert found["combinations"][label]["u"] < 1.0001 * whole
    json.dumps(one["drift_basis"], allow_nan=False)


@pytest.mark.slow
def test_stable_cells_are_called_stable_as_often_as_they_should(run: Any) -> None:
    """Over repeated calibrations of one cell the scores scatter like a standard normal."""
    documents = [run(seed) for seed in range(100, 112)]
    scores = [
        drift(documents[i], documents[i + 1])["combinations"][label]["in_u"]
        for i in range(0, 12, 2)
        for label in LABELS
    ]
    assert 0.5 < float(np.std(scores)) < 1.6
    assert max(map(abs, scores)) < 4


def test_a_small_drift_is_called_though_the_references_are_coarse(run: Any) -> None:
    """With references known to 8 % a gain that moved by 1.5 % is still called a drift."""
    coarse: Campaign = run.stated

    def loose(material: Any) -> Any:
        e = material.youngs_modulus_pa
        return dataclasses.replace(material, youngs_modulus_pa=Quantity(e.value, 0.08 * e.value))

    changed = {
        "spheres": {n: loose(m) for n, m in coarse.spheres.items()},
        "surfaces": {n: loose(m) for n, m in coarse.surfaces.items()},
    }
    found = drift(run(3, **changed), run(4, gain=1.015, **changed))
    gain = found["combinations"]["gain_N_per_V"]
    assert gain["change"] == pytest.approx(0.015, abs=4 * gain["u"])
    assert gain["in_u"] > 3
    assert found["drifted"]


def test_newly_stated_references_do_not_cancel(run: Any) -> None:
    """A reference stated anew between two calibrations counts with its whole uncertainty."""
    sphere = run.stated.spheres["acetal"]
    e = sphere.youngs_modulus_pa
    assert e is not None
    anew = dataclasses.replace(sphere, youngs_modulus_pa=Quantity(e.value * 1.03, e.u))
    same = drift(run(1), run(2))
    other = drift(run(1), run(2, spheres={**run.stated.spheres, "acetal": anew}))
    for label in LABELS[:1]:
        assert other["combinations"][label]["u"] > same["combinations"][label]["u"]


def test_documents_without_basis_are_compared_carefully(run: Any) -> None:
    """An older document is compared by the whole uncertainty of both, and says so."""
    one, two = run(1), run(2)
    old = {k: v for k, v in one.items() if k != "drift_basis"}
    found = drift(old, two)["combinations"]["gain_N_per_V"]
    assert not found["common_cancels"]
    assert found["u"] == pytest.approx(
        math.hypot(
            *(
                x["identifiable"]["gain_N_per_V"]["u"] / x["identifiable"]["gain_N_per_V"]["value"]
                for x in (one, two)
            )
        )
    )


def test_a_series_shows_a_creeping_cell(run: Any) -> None:
    """Steps too small to be called add up to a drift since the first calibration."""
    documents = [run(20 + i, gain=1.004**i) for i in range(5)]
    series = drift_series(documents)
    assert series[0]["since_previous"] is None
    assert [set(s["identifiable"]) for s in series] == [set(LABELS)] * 5
    last = series[-1]["since_first"]["combinations"]["gain_N_per_V"]
    assert last["change"] == pytest.approx(1.004**4 - 1, abs=4 * last["u"])
    assert abs(last["in_u"]) > 2
