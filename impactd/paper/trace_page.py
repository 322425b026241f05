"""What the page says of single traces: the closed model beside KV, pair by pair."""

from __future__ import annotations

from analysis.paper.contact import TABLE3_CELL, Cell
from impactd.aliases import Json
from impactd.paper.pair_traces import PairTraces, Reading, all_pair_traces

CLOSED_HEADINGS = (
    "sphere / surface",
    "coupon / g",
    "ring / kHz",
    "peak, kv2 over kv",
    "E* by kv, M with coupon (free / onset)",
    "R2",
    "E* by kv, M without (free / onset)",
    "R2",
    "E* by kv2",
)
_READINGS = ("loaded", "loaded_onset", "bare", "bare_onset", "kv2")


def closed_model() -> list[Json]:
    """Return what KV and the closed model make of a closed rig, pair by pair."""
    return [_entry(one) for one in all_pair_traces().values()]


def _entry(one: PairTraces) -> Json:
    cell = TABLE3_CELL
    loaded = Cell(cell.mass_kg + one.coupon_kg, cell.stiffness_n_per_m, cell.damping_n_s_per_m)
    readings: dict[str, Reading] = {name: getattr(one, name) for name in _READINGS}
    return {
        "sphere": one.pair[0],
        "surface": one.pair[1],
        "coupon_mass_kg": one.coupon_kg,
        "natural_frequency_Hz": loaded.natural_frequency_hz,
        "peak_over_kv": float(one.closed_rig_v.max() / one.paper_rig_v.max()),
        "ratio": {name: reading.modulus_ratio for name, reading in readings.items()},
        "r2": {name: reading.r2 for name, reading in readings.items()},
    }


def closed_rows(found: list[Json]) -> list[list[str]]:
    """Return `closed_model` as rows of text under `CLOSED_HEADINGS`."""
    return [
        [
            f"{e['sphere']} / {e['surface']}",
            f"{1e3 * e['coupon_mass_kg']:.1f}",
            f"{e['natural_frequency_Hz'] / 1e3:.1f}",
            f"{e['peak_over_kv']:.3f}",
            f"{e['ratio']['loaded']:.3f} / {e['ratio']['loaded_onset']:.2f}",
            f"{e['r2']['loaded']:.4f}",
            f"{e['ratio']['bare']:.2f} / {e['ratio']['bare_onset']:.2f}",
            f"{e['r2']['bare']:.2f}",
            f"{e['ratio']['kv2']:.4f}",
        ]
        for e in found
    ]
