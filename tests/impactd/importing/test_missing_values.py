"""What a campaign still lacks, told in words."""

from __future__ import annotations

import json

from impactd.importing.choices import Choices
from impactd.importing.missing_values import missing_values
from impactd.importing.new_campaign import make_campaign
from impactd.storage.campaign_folder import read_campaign
from tests.recordings import VALUES, simulated_csv


def missing(folder, files, values):
    """Return what a campaign of these files and values lacks."""
    (folder / "values.json").write_text(json.dumps(values))
    made = make_campaign(files, folder / "out", Choices(values=folder / "values.json"))
    return missing_values(read_campaign(made.path))


def test_what_is_not_stated_is_named_and_what_is_stated_is_not(tmp_path):
    """Sphere, coupon, height and cell, each with what is absent; nothing once all is there."""
    content, shots = simulated_csv()
    files = []
    for name, text in content.items():
        (tmp_path / name).write_bytes(text)
        files.append(str(tmp_path / name))
    some = {
        "spheres": {"acetal": {"radius_m": 0.00476}},
        "sensor": {"compliance_m_per_V": {"value": 1.39e-8, "u": 4.2e-10}},
        "shots": {"drop-1": {"sphere": "acetal", "drop_height_m": 0.02}},
    }
    (tmp_path / "some").mkdir()
    assert missing(tmp_path / "some", files, some) == [
        "drop-2, drop-3, drop-4: sphere.",
        "Sphere acetal: mass, Poisson's ratio.",
        "drop-1, drop-2, drop-3, drop-4: coupon.",
        "drop-2, drop-3, drop-4: drop height.",
        "Load cell: crystal mass, crystal stiffness, crystal damping.",
    ]
    assert missing(tmp_path, files, {**VALUES, "shots": shots}) == []
