"""Small real archives, records and campaign folders."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.campaign import Quantity, Sensor, Sphere, Surface
from drivers.digitizer import DigitizerIdentity, Record, TriggerSettings
from impactd.storage.archive import Archive, DropRequest, ShotMetadata

REQUEST = DropRequest("acetal", "polycarbonate", 0.047, "ab")


@pytest.fixture
def archive(tmp_path: Path) -> Iterator[Archive]:
    """Return an open, empty archive."""
    with Archive.open(tmp_path / "archive", reserve_bytes=0) as opened:
        yield opened


@pytest.fixture
def request_body() -> DropRequest:
    """Return what a technician asks for."""
    return REQUEST


@pytest.fixture
def record() -> Callable[..., Record]:
    """Return a maker of records."""

    def make(samples: int = 5000, seed: int = 1, **changes: Any) -> Record:
        generator = np.random.default_rng(seed)
        codes = generator.normal(0.0, 5.0, samples)
        codes[1000:1100] += 8000.0 * np.sin(np.linspace(0.0, np.pi, 100))
        values: dict[str, Any] = {
            "codes": codes.astype(np.int16),
            "volts_per_code": 3.0517578125e-4,
            "offset_v": 0.002,
            "calibrated": True,
            "sample_rate_hz": 990786.0,
            "sample_rate_u_hz": 12.0,
            "range_v": 10.0,
            "trigger_index": 1000,
            "first_sample_index": 123456,
            "trigger_monotonic_ns": 987654321,
            "status_words": (0x000A, 0x000B),
            "samples_streamed": 131072,
        }
        return Record(**(values | changes))

    return make


@pytest.fixture
def metadata() -> ShotMetadata:
    """Return circumstances with every field set."""
    return ShotMetadata(
        started_utc="2026-03-01T12:00:00.000000Z",
        started_monotonic_ns=900000000,
        gravity_m_per_s2=9.81,
        operator="ab",
        sphere=Sphere("acetal", 4.76e-3, 0.6116e-3, Quantity(3.15e9, 6e7), Quantity(0.35, 0.01)),
        surface=Surface("polycarbonate", None, Quantity(0.37, 0.01), 3.6e-3, 2e-3),
        drop_height_m=0.047,
        speed_repeatability=0.003,
        valve_monotonic_ns=950000000,
        valve_identity="Numato 1-channel",
        valve_confirmed=True,
        vacuum_v=2.5,
        digitizer=DigitizerIdentity("Personal Daq/3001", "S1", "0x0100", "aa", None, "untested"),
        trigger=TriggerSettings(0.05, 0.02, 1000, 5000),
        baseline_v=0.001,
        noise_rms_v=0.0015,
        sensor=Sensor(Quantity(5.6e-9, 2e-10), covariance=np.diag([0.1, 0.2, 0.3, 0.4])),
        calibration=7,
        restitution=Quantity(0.82, 0.01),
        configuration={"rig": {"name": "bench 3"}, "trigger": {"level_v": 0.05}},
        software="impactd 1.2.3",
        notes=("valve warm",),
    )


@pytest.fixture
def stored(
    archive: Archive, record: Callable[..., Record], metadata: ShotMetadata
) -> Callable[..., int]:
    """Return a function that stores a shot and returns its number."""

    def store(**changes: Any) -> int:
        drop, _ = archive.begin_drop(REQUEST, owner="anna")
        return archive.store_shot(drop.number, record(**changes), metadata).number

    return store


@pytest.fixture
def campaign_folder(tmp_path: Path) -> Callable[..., Path]:
    """Return a maker of campaign folders: three good shots, then whatever ``change`` does."""

    def make(change: Callable[[dict[str, Any], Path], None] | None = None) -> Path:
        folder = tmp_path / "campaign"
        folder.mkdir()
        generator = np.random.default_rng(3)
        shots = []
        for i in range(3):
            codes = generator.normal(0.0, 5.0, 500)
            codes[200:260] += 4000.0 * np.sin(np.linspace(0.0, np.pi, 60))
            np.save(folder / f"shot{i:03d}.npy", codes.astype(np.int16))
            shots.append(
                {
                    "file": f"shot{i:03d}.npy",
                    "sample_rate_Hz": 1000000,
                    "volts_per_code": 0.00030517578125,
                    "trigger_index": 200,
                    "sphere": "acetal",
                    "surface": "specimen",
                    "drop_height_m": 0.047,
                    "restitution": {"value": 0.82, "u": 0.01},
                }
            )
        root = {
            "format": "impactd-campaign/1",
            "gravity_m_per_s2": 9.81,
            "release": {"speed_repeatability": 0.003},
            "sensor": {
                "compliance_m_per_V": {"value": 5.6e-9, "u": 2e-10},
                "crystal_mass_kg": {"value": 0.0354, "u": 0.0031},
                "crystal_stiffness_N_per_m": {"value": 4.16e8, "u": 4.2e7},
                "crystal_damping_N_s_per_m": {"value": 560, "u": 60},
                "hsd_N_per_V": {"value": 1.78, "u": 0.09},
            },
            "spheres": {
                "acetal": {
                    "radius_m": 0.00476,
                    "mass_kg": 0.0006116,
                    "youngs_modulus_Pa": {"value": 3.15e9, "u": 6e7},
                    "poissons_ratio": {"value": 0.35, "u": 0.01},
                }
            },
            "surfaces": {
                "specimen": {
                    "youngs_modulus_Pa": None,
                    "poissons_ratio": {"value": 0.37, "u": 0.02},
                    "coupon_mass_kg": 0.0036,
                }
            },
            "shots": shots,
        }
        if change is not None:
            change(root, folder)
        (folder / "campaign.json").write_text(json.dumps(root))
        return folder

    return make
