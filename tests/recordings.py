"""Recordings of the simulated rig as somebody has them: text files, with what was measured."""

from __future__ import annotations

import dataclasses
import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.campaign import CampaignSettings, simulate_campaign

VALUES: dict[str, Any] = {
    "release": {"speed_repeatability": 0.003},
    "spheres": {
        "acetal": {
            "radius_m": {"value": 0.00476, "u": 2e-6},
            "mass_kg": {"value": 6.116e-4, "u": 2e-7},
            "youngs_modulus_Pa": {"value": 3.15e9, "u": 6.3e7},
            "poissons_ratio": {"value": 0.35, "u": 0.01},
        }
    },
    "surfaces": {
        "aluminium": {
            "youngs_modulus_Pa": {"value": 69e9, "u": 1e9},
            "poissons_ratio": {"value": 0.33, "u": 0.01},
            "coupon_mass_kg": 0.0081,
        },
        "specimen": {
            "youngs_modulus_Pa": None,
            "poissons_ratio": {"value": 0.42, "u": 0.02},
            "coupon_mass_kg": 0.00375,
        },
    },
    "sensor": {
        "compliance_m_per_V": {"value": 1.39e-8, "u": 4.2e-10},
        "crystal_mass_kg": {"value": 0.0354, "u": 0.0031},
        "crystal_stiffness_N_per_m": {"value": 4.16e8, "u": 4.2e7},
        "crystal_damping_N_s_per_m": {"value": 560, "u": 60},
    },
}
"""What the README's block states, without the shots."""


def simulated_drops(*heights_m: float) -> dict[str, Any]:
    """Return a simulated campaign: one sphere on two coupons from two heights."""
    usual = CampaignSettings()
    settings = dataclasses.replace(
        usual,
        spheres={"acetal": usual.spheres["acetal"]},
        surfaces={name: usual.surfaces[name] for name in ("aluminium", "specimen")},
        drop_heights_m=heights_m,
        repeats=1,
    )
    return simulate_campaign(settings, seed=3)


def as_csv(shot: dict[str, Any], codes: NDArray[Any], header: str) -> bytes:
    """Return a shot of a simulated campaign as a table of times [s] and volts."""
    volts = codes * shot["volts_per_code"]
    columns = np.column_stack((np.arange(volts.size) / shot["sample_rate_Hz"], volts))
    text = io.BytesIO()
    np.savetxt(text, columns, fmt="%.7g", delimiter=",", header=header, comments="")
    return text.getvalue()


def simulated_csv() -> tuple[dict[str, bytes], dict[str, dict[str, Any]]]:
    """Return four recordings as CSV by file name, and which drop each was, by shot."""
    made = simulated_drops(0.0191, 0.0444)
    files, shots = {}, {}
    for number, (shot, codes) in enumerate(
        zip(made["campaign"]["shots"], made["codes"], strict=True), start=1
    ):
        files[f"drop-{number}.csv"] = as_csv(shot, codes, "time_s,voltage_V")
        shots[f"drop-{number}"] = {key: shot[key] for key in ("sphere", "surface", "drop_height_m")}
    return files, shots
