"""Tables 3-5 from simulated rigs: cells with Table 3's scatter, the paper's pairs."""

from __future__ import annotations

import math
import statistics
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

from analysis import CalibrationResult, Campaign, FitResult, calibrate, fit_campaign
from analysis.fit.shot_fit import ShotFit
from analysis.paper.contact import GRAVITY_M_PER_S2, Cell
from analysis.paper.fits import Known, fit_gain, fit_modulus, predict
from drivers.simulated.campaign import CampaignSettings, simulate_campaign, write_campaign_folder
from drivers.simulated.specimens import SPHERES, SURFACES, CellSpec
from impactd.paper.source import literature_reduced, rows, tables
from impactd.storage.campaign_folder import read_campaign

Pair = tuple[str, str]

REFERENCES: tuple[Pair, ...] = tuple(
    (sphere, surface)
    for sphere in ("acetal", "polypropylene", "hdpe")
    for surface in ("aluminium", "polycarbonate")
)
"""Pairs whose stated moduli calibrate the cell; the paper does not say which it used."""
RANGE_V = 100.0
"""Steel on aluminium gives 50 V at Table 3's compliance; the paper must have set a gain for it."""
WAYS = ("hsd_onset", "hsd_aligned", "kv_aligned", "kv_joint")


@dataclass
class PairFigures:
    """What the fits say of one pair, over all rigs.

    Attributes
    ----------
    ratio : dict of list
        E* over the true one, by way of fitting; one per rig (mean over its shots).
    r2 : dict of list
        The same of R2.
    u_relative : list
        u(E*)/E* as the joint fit states it; one per rig.
    contact_time_s : float
        From the largest height.
    """

    ratio: dict[str, list[float]] = field(default_factory=lambda: {w: [] for w in WAYS})
    r2: dict[str, list[float]] = field(default_factory=lambda: {w: [] for w in WAYS})
    u_relative: list[float] = field(default_factory=list)
    contact_time_s: float = 0.0


@dataclass
class RigFigures:
    """What the calibrations and fits of all rigs say.

    Attributes
    ----------
    true_cells, found_cells : list of dict
        M, k, mu, c, S = k c, f0 and damping ratio by name; one per rig. SI.
    hsd_gain : dict of list
        Eq. 7's S by way of reading it: ``onset``, ``aligned``, ``peak``; one per rig. [N/V]
    calibration_r2 : dict of list
        ``hsd_onset``, ``hsd_aligned`` and ``kv``; one per shot of a reference pair.
    pairs : dict
        By (sphere, surface), the paper's pairs.
    campaigns : list
        (campaign, joint fit, calibration) of the first rig, for pictures.
    """

    true_cells: list[dict[str, float]] = field(default_factory=list)
    found_cells: list[dict[str, float]] = field(default_factory=list)
    hsd_gain: dict[str, list[float]] = field(
        default_factory=lambda: {"onset": [], "aligned": [], "peak": []}
    )
    calibration_r2: dict[str, list[float]] = field(
        default_factory=lambda: {"hsd_onset": [], "hsd_aligned": [], "kv": []}
    )
    pairs: dict[Pair, PairFigures] = field(default_factory=dict)
    first: tuple[Campaign, FitResult, CalibrationResult] | None = None


def table_3_cell() -> CellSpec:
    """Return a certificate with Table 3's means and standard deviations."""
    kv = tables()["load_cell"]["kv"]
    c, M, k, mu = (
        kv[name]
        for name in (
            "compliance_m_per_V",
            "crystal_mass_kg",
            "crystal_stiffness_N_per_m",
            "crystal_damping_N_s_per_m",
        )
    )
    return CellSpec(*c, *M, *k, *mu)


def run_rigs(count: int, seed: int = 1, tell: Callable[[str], None] | None = None) -> RigFigures:
    """Simulate rigs, drop every pair of the paper, fit in every way.

    Parameters
    ----------
    count : int
        Rigs, > 1; about 5 s each.
    seed : int
        Of the first; the others follow.
    tell : callable, optional
        Told in words what is being done.

    Returns
    -------
    RigFigures
        Of all.
    """
    pairs = rows("table5_kv")
    found = RigFigures(pairs={pair: PairFigures() for pair in pairs})
    settings = CampaignSettings(
        spheres={name: SPHERES[name] for name in dict.fromkeys(p[0] for p in pairs)},
        surfaces={name: SURFACES[name] for name in dict.fromkeys(p[1] for p in pairs)},
        cell=table_3_cell(),
        fill=None,
        range_v=RANGE_V,
        repeats=1,
        rig="paper",
    )
    for number in range(count):
        if tell is not None:
            tell(f"simulated rig {number + 1} of {count}")
        _one_rig(found, settings, seed + number)
    return found


def _one_rig(found: RigFigures, settings: CampaignSettings, seed: int) -> None:
    made = simulate_campaign(settings, seed)
    with tempfile.TemporaryDirectory() as folder:
        campaign = read_campaign(write_campaign_folder(Path(folder), made))
    truth = made["truth"]
    true_moduli = {
        (shot["sphere"], shot["surface"]): float(true["reduced_modulus_Pa"])
        for shot, true in zip(made["campaign"]["shots"], truth["shots"], strict=True)
    }
    calibration = calibrate(
        replace(
            campaign, shots=tuple(s for s in campaign.shots if (s.sphere, s.surface) in REFERENCES)
        ),
        "kv",
    )
    kept = tuple(s for s in campaign.shots if (s.sphere, s.surface) in found.pairs)
    campaign = replace(campaign, shots=kept, sensor=calibration.sensor)
    joint = fit_campaign(campaign, "kv", by_pair=True, heldout=False)
    if found.first is None:
        found.first = (campaign, joint, calibration)
    sensor = truth["sensor"]
    found.true_cells.append(
        _cell_numbers(
            *(
                float(sensor[name])
                for name in (
                    "crystal_mass_kg",
                    "crystal_stiffness_N_per_m",
                    "crystal_damping_N_s_per_m",
                    "compliance_m_per_V",
                )
            )
        )
    )
    cell, compliance = calibrated_cell(calibration)
    found.found_cells.append(
        _cell_numbers(cell.mass_kg, cell.stiffness_n_per_m, cell.damping_n_s_per_m, compliance)
    )
    _calibrate_rigid(found, joint.shots)
    found.calibration_r2["kv"].extend(s.r2 for s in calibration.fit.shots)
    _fit_pairs(found, joint, true_moduli, cell, compliance)


def calibrated_cell(calibration: CalibrationResult) -> tuple[Cell, float]:
    """Return the crystal and its compliance as a calibration found them. [SI, m/V]"""
    numbers = calibration.to_json()["parameters"]
    M, k, mu, c = (
        float(numbers[name]["value"])
        for name in (
            "crystal_mass_kg",
            "crystal_stiffness_n_per_m",
            "crystal_damping_n_s_per_m",
            "compliance_m_per_v",
        )
    )
    return Cell(M, k, mu), c


def _cell_numbers(M: float, k: float, mu: float, c: float) -> dict[str, float]:
    cell = Cell(M, k, mu)
    return {
        "crystal_mass_kg": M,
        "crystal_stiffness_N_per_m": k,
        "crystal_damping_N_s_per_m": mu,
        "compliance_m_per_V": c,
        "gain_N_per_V": k * c,
        "natural_frequency_Hz": cell.natural_frequency_hz,
        "damping_ratio": cell.damping_ratio,
    }


def known_of(shot: ShotFit, gain_n_per_v: float, cell: Cell | None) -> Known:
    """Return what the paper's fits hold fixed for one shot.

    Parameters
    ----------
    shot : ShotFit
        Of our joint KV fit; only its touch-down is taken from it.
    gain_n_per_v : float
        S of Eq. 7, or k c. [N/V]
    cell : Cell or None
        None for HSD.

    Returns
    -------
    Known
        Speed from the height, restitution as measured.
    """
    recorded = shot.item.shot
    assert recorded.drop_height_m is not None
    assert recorded.restitution is not None
    return Known(
        gain_n_per_v=gain_n_per_v,
        cell=cell,
        speed_m_per_s=math.sqrt(2 * GRAVITY_M_PER_S2 * recorded.drop_height_m),
        restitution=recorded.restitution.value,
        touch_down_us=float(shot.own[2]),
    )


def _pair(shot: ShotFit) -> Pair:
    return str(shot.item.shot.sphere), str(shot.item.shot.surface)


def _calibrate_rigid(found: RigFigures, shots: Iterable[ShotFit]) -> None:
    """Read Eq. 7's S off the reference pairs in three ways, with the moduli on their labels."""
    gains: dict[str, list[float]] = {"onset": [], "aligned": [], "peak": []}
    for shot in shots:
        if _pair(shot) not in REFERENCES:
            continue
        known, modulus = known_of(shot, 1.0, None), literature_reduced(_pair(shot))
        for way in ("onset", "aligned"):
            gain, r2 = fit_gain(shot.item, known, modulus, free_timing=way == "aligned")
            gains[way].append(gain)
            found.calibration_r2[f"hsd_{way}"].append(r2)
        gains["peak"].append(peak_gain(shot, known, modulus))
    for way, values in gains.items():
        found.hsd_gain[way].append(statistics.fmean(values))


def peak_gain(shot: ShotFit, known: Known, reduced_modulus_pa: float) -> float:
    """Return Eq. 7's S as peak of the computed force over peak of the signal. [N/V]"""
    force = predict(shot.item, replace(known, gain_n_per_v=1.0), reduced_modulus_pa)
    window = shot.item.window
    return float((force - window.baseline).max() / window.peak)


def _fit_pairs(
    found: RigFigures,
    joint: FitResult,
    true_moduli: dict[Pair, float],
    cell: Cell,
    compliance: float,
) -> None:
    gain = cell.stiffness_n_per_m * compliance
    onset, aligned = found.hsd_gain["onset"][-1], found.hsd_gain["aligned"][-1]
    ways = {
        "hsd_onset": (onset, None, False),
        "hsd_aligned": (aligned, None, True),
        "kv_aligned": (gain, cell, True),
    }
    ratios: dict[Pair, dict[str, list[float]]] = {p: {w: [] for w in WAYS} for p in found.pairs}
    r2: dict[Pair, dict[str, list[float]]] = {p: {w: [] for w in WAYS} for p in found.pairs}
    for shot in joint.shots:
        pair = _pair(shot)
        figures, true = found.pairs[pair], true_moduli[pair]
        figures.contact_time_s = max(figures.contact_time_s, shot.contact_time_s)
        for way, (s, crystal, free) in ways.items():
            known = known_of(shot, s, crystal)
            fit = fit_modulus(shot.item, known, literature_reduced(pair), free_timing=free)
            ratios[pair][way].append(fit.reduced_modulus_pa / true)
            r2[pair][way].append(fit.r2)
        r2[pair]["kv_joint"].append(shot.r2)
    for entry in joint.pairs().values():
        pair = (str(entry["sphere"]), str(entry["surface"]))
        modulus = entry["reduced_modulus_Pa"]
        ratios[pair]["kv_joint"].append(float(modulus["value"]) / true_moduli[pair])
        found.pairs[pair].u_relative.append(float(modulus["u"]) / float(modulus["value"]))
    for pair, figures in found.pairs.items():
        for way in WAYS:
            figures.ratio[way].append(statistics.fmean(ratios[pair][way]))
            figures.r2[way].append(statistics.fmean(r2[pair][way]))
