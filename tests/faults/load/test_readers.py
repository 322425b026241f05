"""The benchmark of readers, from an archive that is made to figures beside their references."""

from __future__ import annotations

import pytest

from impactd.bench.large_archive import FittedShot
from impactd.bench.readers import measure_readers
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
    "model": "kv",
    "outcome": {"status": "converged", "message": "ok"},
    "pairs": {"acetal/aluminium": PAIR},
}


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_readers_are_timed_beside_their_references() -> None:
    """Every time is laid beside one of the same run; what was asked for was answered."""
    figures = measure_readers([FittedShot(SHOT, {"kv": RESULT})], shots=20, rounds=3)

    assert [figure.name.partition(":")[0].partition(" at ")[0] for figure in figures] == [
        "GET /v1/moduli",
        "GET /v1/moduli",
        "POST /v1/abort beside 4 such readers",
        "POST /v1/abort beside 4 such readers",
        "memory of the daemon for 20 shots, readers included",
    ]
    for figure in figures:
        assert figure.value
        assert figure.reference is not None
        assert figure.reference > 0
