"""What a notebook shows of a fit."""

from __future__ import annotations

import dataclasses
import re
from html import unescape

import pytest

from analysis import fit_campaign
from analysis.diagnosing import Diagnosis
from analysis.moduli_html import moduli_html
from analysis.written_numbers import measured
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from impactd.storage.campaign_folder import read_campaign


@pytest.fixture(scope="module")
def fit(tmp_path_factory):
    """One sphere on a reference and on the specimen."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={"acetal": usual.spheres["acetal"]},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=(0.0465,),
        repeats=1,
    )
    folder = write_campaign_folder(tmp_path_factory.mktemp("few"), simulate_campaign(settings, 5))
    return fit_campaign(read_campaign(folder), "kv2")


def test_a_fit_is_a_table_of_its_moduli(fit):
    """Every modulus with U to the digits of all other places, k, model and outcome."""
    shown = unescape(fit._repr_html_())
    assert f"<b>kv2</b>: {fit.outcome.message} U = k u, k = 1.96 (95 %)" in shown
    rows = {
        cells[0]: cells[1:]
        for row in re.findall(r"<tr>(<td>.*?)</tr>", shown)
        if (cells := re.findall(r"<td>(.*?)</td>", row))
    }
    assert set(rows) == set(fit.moduli())
    for name, entry in fit.moduli().items():
        young, plane = (
            measured(entry[key], scale=1e-9, sign="±")
            for key in ("youngs_modulus_Pa", "plane_strain_modulus_Pa")
        )
        assert rows[name][:3] == [entry["status"], young, plane]
        reference = entry["status"] == "reference"
        assert rows[name][3].startswith("stated ") == reference


def test_what_was_typed_is_no_markup_and_what_is_withheld_says_why():
    """A name of a material is text."""
    entry = {"status": "withheld", "reason": "State it.", "side": "surface"}
    entry |= {"youngs_modulus_Pa": None, "plane_strain_modulus_Pa": None}
    shown = moduli_html("kv2", "The fit converged.", {"<b>a</b>": entry})
    assert "<td>&lt;b&gt;a&lt;/b&gt;</td><td>withheld</td><td>-</td><td>-</td>" in shown
    assert "State it." in shown
    assert "no modulus" in moduli_html("kv2", "The fit converged.", {})


def test_a_diagnosis_is_its_verdict_above_the_moduli(fit):
    """A dictionary to programs; a notebook shows what it says, escaped."""
    document = {"verdict": "not_identifiable", "sentence": "u > E.", "after": fit.to_json()}
    shown = Diagnosis(document)._repr_html_()
    assert "<b>kv2</b>: NOT IDENTIFIABLE. u &gt; E." in shown
    assert "<td>specimen</td>" in shown
