"""Archives of many shots, made for benchmarks."""

from __future__ import annotations

import json
from pathlib import Path

from impactd.bench.large_archive import FittedShot, fill_archive
from impactd.moduli.service import ModuliService
from impactd.settings.materials import load_materials
from impactd.settings.settings import find_config
from impactd.storage.archive import Archive
from impactd.storage.shots import Shot

SHOT = Shot(
    number=1,
    file="shots/000001.h5",
    sha256="0" * 64,
    size_bytes=1,
    source="import",
    origin="simulated",
    started_utc="2026-01-01T00:00:00.000000Z",
    stored_utc="2026-01-01T00:00:00.000000Z",
    sphere="acetal",
    surface="aluminium",
    drop_height_m=0.03,
    operator="",
    quantity="voltage",
    sample_rate_hz=1e6,
    samples=4096,
    trigger_index=1000,
    peak=1.0,
    clipped=False,
)
PAIR = {
    "sphere": "acetal",
    "surface": "aluminium",
    "reduced_modulus_Pa": {"value": 3.5e9, "u": 1e7, "unit": "Pa"},
    "u_calibration_Pa": 3e6,
    "d_ln_reduced_modulus_d_ln_sensor": {
        "crystal_mass_kg": 0.01,
        "crystal_stiffness_n_per_m": 0.01,
        "crystal_damping_n_s_per_m": 0.01,
        "compliance_m_per_v": 0.01,
    },
}
RESULT = {
    "model": "kv2",
    "outcome": {"status": "converged", "message": "ok"},
    "pairs": {"acetal/aluminium": PAIR},
}


def test_an_archive_is_filled_with_fitted_shots_and_goes_on(tmp_path: Path) -> None:
    """Every shot has its row, drop and fit; more are added behind; the moduli rest on all."""
    template = FittedShot(SHOT, {"kv2": RESULT})
    fill_archive(tmp_path, [template], 7)
    fill_archive(tmp_path, [template], 2)

    with Archive.open(tmp_path, reserve_bytes=0) as archive:
        found = ModuliService(archive).answer(load_materials(find_config("materials.toml")))
        assert [one["number"] for one in json.loads(found.lists["shots"])] == list(range(1, 10))
        assert found.head["pairs"]["acetal/aluminium"]["shots"] == 9
        assert archive.drop(9).state == "analysed"
        assert not list(archive._index.problems())
        assert archive._numbers.draw() == 10
