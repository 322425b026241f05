"""What a converter or an amplifier does without a name is learned and holds on other shots."""

from __future__ import annotations

import pytest

from analysis.diagnosis.discrepancy.fit import learn
from analysis.fit import joint
from analysis.fit.campaign_fit import heldout_rms
from analysis.fit.problem import build
from analysis.fit.start import with_start
from analysis.model.impact_model import model_named

from .conftest import small_campaign


@pytest.mark.parametrize(
    ("effect", "values", "part"),
    [
        ("x_slew_limit", {"limit_v_per_s": 1.5e5}, ("slew", "rig")),
        ("x_lost_samples", {"lost_s": 2e-6}, ("jump", "shot")),
        (
            "x_adc_nonlinearity",
            {"amplitude_codes": 60.0, "period_codes": 700.0},
            ("ripple", "rig"),
        ),
        (
            "x_thermal_tail",
            {"offset_per_v_s": 40.0, "cooling_s": 1e-3},
            ("warmth", "rig"),
        ),
        (
            "x_interleaved_converter",
            {"mismatch": 0.04, "skew_s": 3e-8},
            ("alternate", "shot"),
        ),
    ],
)
def test_what_no_library_names_is_learned_and_holds_on_other_shots(tmp_path, effect, values, part):
    """The error on held-out shots falls at least threefold."""
    problem = build(small_campaign(tmp_path, effect, **values), model_named("kv2"))
    problem, nuisances = with_start(problem)
    fitted = joint.fit(problem, nuisances)
    before = heldout_rms(problem, fitted)
    learned = learn(problem, fitted, [part])
    assert learned.heldout_rms < before / 3
