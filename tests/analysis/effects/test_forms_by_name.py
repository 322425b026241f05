"""Forms that are fitted where a model names them, on records of the simulated rig's own chain."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import pytest

from analysis.diagnosis.basis.proposals import proposals
from analysis.effects.library import library
from analysis.fit.campaign_fit import fit_campaign
from analysis.fit.problem import build
from analysis.fit.result import FitResult
from analysis.model.impact_model import model_named
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.effects import make_effect
from drivers.simulated.effects.effect import Effect
from impactd.storage.campaign_folder import read_campaign

SEED = 3


def fitted(folder: Path, acting: Effect, model: str) -> FitResult:
    """Return a model's fit to eight shots."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={name: usual.spheres[name] for name in ("acetal", "acetal_small")},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0115, 0.0465),
        repeats=1,
        effects=(acting,),
    )
    made = simulate_campaign(settings, SEED)
    return fit_campaign(read_campaign(write_campaign_folder(folder, made)), model)


def parameter(found: FitResult, name: str) -> tuple[float, float]:
    """Return a number of an effect with its standard uncertainty."""
    stated = found.parameters()[name]
    return stated["value"], stated["u"]


@pytest.mark.parametrize(
    ("form", "order", "cutoff_hz"),
    [("butterworth", 4, 3e4), ("bessel", 8, 3e4)],
)
def test_an_anti_alias_filter_is_found_by_its_name(
    tmp_path: Path, form: str, order: int, cutoff_hz: float
) -> None:
    """Its cut-off comes out, and nothing is left."""
    acting = make_effect(
        "amplifier_lowpass", {"cutoff_hz": cutoff_hz, "filter_order": order}, form=form
    )
    name = f"amplifier_lowpass:{form}_{order}"
    found = fitted(tmp_path, acting, f"kv2+{name}")
    value, u = parameter(found, f"{name}.cutoff_hz")
    assert value == pytest.approx(cutoff_hz, abs=4 * u)
    assert u < 0.05 * cutoff_hz
    assert found.chi2_per_dof < 1.05


def test_a_coupler_of_two_poles_is_found_by_its_name(tmp_path: Path) -> None:
    """Both of its times come out, where one pole leaves most of it."""
    acting = make_effect("x_two_pole_coupler", {"frequency_hz": 200.0, "damping_ratio": 0.4})
    turn = 2 * 3.141592653589793 * 200.0
    found = fitted(tmp_path / "two", acting, "kv2+coupler_highpass:two_pole")
    for name, wanted in (("time_constant_s", 1 / (0.8 * turn)), ("return_time_s", 0.8 / turn)):
        value, u = parameter(found, f"coupler_highpass:two_pole.{name}")
        assert value == pytest.approx(wanted, abs=4 * u)
        assert u < 0.01 * wanted
    assert found.chi2_per_dof < 1.05
    assert fitted(tmp_path / "one", acting, "kv2+coupler_highpass").chi2_per_dof > 10.0


def test_a_gain_that_drifts_is_found_by_its_name(tmp_path: Path) -> None:
    """A gain that grows by 6.6 % over the drops is stated so, and the modulus is right again."""
    acting = make_effect("x_gain_drift", {"final_change": 1.0, "shots_to_settle": 100.0})
    found = fitted(tmp_path / "with", acting, "kv2+gain_drift")
    value, u = parameter(found, "gain_drift.relative_change")
    # the eight gains are 1 to 1.0676, nearly straight, their middle 1.035
    assert value == pytest.approx(0.0676 / 1.035, abs=4 * u)
    assert found.chi2_per_dof < 1.05
    assert fitted(tmp_path / "without", acting, "kv2").chi2_per_dof > 1.1


def test_what_is_fitted_by_name_is_not_tried(made) -> None:
    """The search for effects neither proposes nor refuses it; everything else is as it was."""
    problem = build(made[1], model_named("kv2"))
    found, refused = proposals(problem)
    named = {e.id for listed in library().values() for e in (listed, *listed.variants) if e.by_name}
    assert {"gain_drift", "coupler_highpass:two_pole", "amplifier_lowpass:bessel_6"} <= named
    assert not named & ({p.effect.id for p in found} | set(refused))
