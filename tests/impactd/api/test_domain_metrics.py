"""What the rig measures, as Prometheus reads it."""

from __future__ import annotations

import re
import shutil
import subprocess

import pytest

from impactd.api.domain_metrics import _cell


def value(text: str, name: str, **labels: str) -> float | None:
    """Return a sample of a scrape, None where there is none."""
    for line in text.splitlines():
        found = re.fullmatch(rf"{name}(?:\{{(.*)\}})? (\S+)", line)
        if found and all(f'{key}="{one}"' in (found[1] or "") for key, one in labels.items()):
            return float(found[2])
    return None


def test_the_last_modulus_of_a_pair_comes_with_its_u(rig, shot) -> None:
    """The newest shot's reduced modulus and U are those of the API; noise and disk are told."""
    text = rig.anybody.get("/metrics").text
    newest = rig.reader.get("/v1/shots", params={"summary": True, "limit": 200}).json()["items"]
    pair = {"sphere": shot["sphere"], "surface": shot["surface"]}
    mine = next(one for one in newest if pair.items() <= one.items() and one["advice"] != "repeat")
    told = mine["reduced_modulus_Pa"]
    name = "impactd_last_reduced_modulus"
    assert value(text, f"{name}_pascals", **pair) == pytest.approx(told["value"])
    wide = value(text, f"{name}_expanded_uncertainty_pascals", **pair)
    assert wide == pytest.approx(told["expanded"]["U"])
    assert 0 < value(text, "impactd_noise") < 0.02
    assert value(text, "impactd_disk_seconds_left") > 0


def test_what_is_not_known_has_no_sample(rig) -> None:
    """A family without a value is there by name alone; nothing draws a zero."""
    text = rig.anybody.get("/metrics").text
    assert "# TYPE impactd_cell_gain_newtons_per_volt gauge" in text
    assert value("", "impactd_cell_gain_newtons_per_volt") is None


def test_a_cell_that_moved_is_told_in_its_uncertainties() -> None:
    """Two calibrations give gain, frequency and the largest change over its uncertainty."""

    def document(gain: float) -> dict:
        return {"identifiable": {
            "gain_N_per_V": {"value": gain, "u": 0.01, "expanded": {"U": 0.0196}},
            "natural_frequency_Hz": {"value": 17e3, "u": 30.0, "expanded": {"U": 58.8}},
        }}  # fmt: skip

    found = {
        sample.name: sample.value
        for family in _cell([document(5.1), document(5.0)])
        for sample in family.samples
    }
    assert found["impactd_cell_gain_newtons_per_volt"] == 5.1
    assert found["impactd_cell_frequency_hertz_expanded_uncertainty"] == 58.8
    # ln(5.1 / 5) over hypot(0.01 / 5, 0.01 / 5.1)
    assert found["impactd_cell_drift"] == pytest.approx(0.019803 / 0.0028006, rel=1e-3)


@pytest.mark.skipif(shutil.which("promtool") is None, reason="needs promtool")
def test_promtool_has_nothing_to_say_of_a_scrape(rig, shot) -> None:
    """The text of a scrape is well formed and named as Prometheus wants it."""
    text = rig.anybody.get("/metrics").text
    made = subprocess.run(
        ["promtool", "check", "metrics"], input=text, capture_output=True, text=True, check=False
    )
    assert made.returncode == 0, made.stderr
