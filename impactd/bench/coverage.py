"""Coverage of the stated uncertainties over simulated campaigns with random truths.

Each campaign draws its spheres, its surfaces, moduli, cell, losses, heights and noise anew, from
the uncertainties that its labels state. It is fitted in the two ways that the program knows:

``joint``
    All shots together (`analysis.fit_campaign`).
``archive``
    The cell from drops on the references (`analysis.calibrate`), every other shot by itself, and
    the network of moduli (`analysis.adjust_moduli`), as the daemon does it.

A 95 % interval that is true holds the truth in 95 of 100 campaigns, neither fewer nor more.

The truths come from the simulated rig, which shares no code with the analysis.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from analysis import adjust_moduli, calibrate, fit_campaign, observations_from_fit
from analysis.campaign import Campaign
from analysis.pair_observation import PairObservation
from analysis.written_numbers import K_95
from drivers.simulated.campaign import (
    CampaignSettings,
    simulate_campaign,
    write_campaign_folder,
)
from drivers.simulated.label_spread import SPREADS
from drivers.simulated.noise import NoiseSettings
from drivers.simulated.rig_model import DEFAULT_RIG, RIGS
from drivers.simulated.specimens import SPHERES, SURFACES
from impactd import blas_threads
from impactd.aliases import Json
from impactd.bench.figure import Figure
from impactd.bench.simulated_campaign import BASES
from impactd.storage.campaign_folder import read_campaign

CAMPAIGNS = 300
SEED = 1
QUICK_CAMPAIGNS = 24
LEVELS = {"68": 1.0, "95": K_95}
ALLOWED = {"68": (0.63, 0.73), "95": (0.92, 0.98)}

POLYMERS = ("acetal", "acetal_small", "polypropylene", "hdpe", "ptfe")
"""Spheres that a campaign draws from; steel's contact is too short to show its law."""
REFERENCE = "aluminium"
CHECKS = ("polycarbonate", "pvc", "ptfe")
"""Surfaces of stated modulus, of which each campaign has one beside the reference."""


@dataclass(frozen=True)
class Pull:
    """One stated quantity against the truth.

    Attributes
    ----------
    way : str
        ``joint`` or ``archive``.
    noise : str
        ``white`` or ``coloured``.
    kind : str
        What sort of quantity, e.g. ``E of specimen``.
    campaign : int
        Seed of the campaign.
    name : str
        Which one, e.g. ``acetal/specimen``.
    score : float
        Stated less true, over the stated standard uncertainty, in logarithms. [1]
    u : float
        Stated relative standard uncertainty. [1]
    """

    way: str
    noise: str
    kind: str
    campaign: int
    name: str
    score: float
    u: float


@dataclass(frozen=True)
class Rigs:
    """Which rigs are simulated.

    Attributes
    ----------
    labels : str
        ``"exact"``: radii, masses, heights and time base are as stated; ``"typical"``: drawn around
        it.
    states_u : bool
        Whether the campaigns state how far they may be off.
    """

    rig: str = DEFAULT_RIG
    labels: str = "exact"
    states_u: bool = True


def draw_settings(seed: int, rigs: Rigs | None = None) -> CampaignSettings:
    """Return a campaign's contents, drawn at random.

    Parameters
    ----------
    seed : int
        Even seeds have white noise, odd ones autoregressive noise.

    Returns
    -------
    CampaignSettings
        Two or three spheres, three surfaces, two or three heights, one or two drops each.
    """
    rigs = rigs or Rigs()
    rng = np.random.default_rng([seed, 900])
    spheres = sorted(rng.choice(POLYMERS, size=int(rng.integers(2, 4)), replace=False).tolist())
    surfaces = (REFERENCE, str(rng.choice(CHECKS)), "specimen")
    heights = np.exp(rng.uniform(math.log(0.01), math.log(0.06), int(rng.integers(2, 4))))
    return CampaignSettings(
        spheres={name: SPHERES[name] for name in spheres},
        surfaces={name: SURFACES[name] for name in surfaces},
        drop_heights_m=tuple(float(h) for h in np.sort(heights)),
        repeats=int(rng.integers(1, 3)),
        noise=NoiseSettings(
            rms_v=float(np.exp(rng.uniform(math.log(5e-4), math.log(5e-3)))),
            ar1=float(rng.uniform(0.3, 0.8)) if seed % 2 else 0.0,
            pink_corner_hz=0.0,
        ),
        restitution_seen_after_s=0.0,
        rig=rigs.rig,
        spread=SPREADS[rigs.labels],
        states_u=rigs.states_u,
    )


def campaign_pulls(seed: int, rigs: Rigs | None = None) -> list[Pull]:
    """Simulate one campaign, fit it in both ways, and compare the results with the truth.

    Returns
    -------
    list of Pull
        What was withheld is not among them.
    """
    settings = draw_settings(seed, rigs)
    simulated = simulate_campaign(settings, seed)
    with tempfile.TemporaryDirectory() as folder:
        campaign = read_campaign(write_campaign_folder(Path(folder), simulated))
    truth = simulated["truth"]
    found = []
    for way, fit in (("joint", _joint), ("archive", _archive)):
        for kind, name, stated in fit(campaign, BASES[settings.rig]):
            true = _true_value(truth, kind, name)
            u = stated["u"] / stated["value"]
            score = math.log(stated["value"] / true) / u
            found.append(Pull(way, "coloured" if seed % 2 else "white", kind, seed, name, score, u))
    return found


def _joint(campaign: Campaign, base: str) -> Iterator[tuple[str, str, Json]]:
    result = fit_campaign(campaign, base, heldout=False)
    yield from _cell(result.parameters())
    yield from _moduli(result.moduli())
    for name, pair in result.pairs().items():
        yield "E* of a pair", name, pair["reduced_modulus_Pa"]


def _archive(campaign: Campaign, base: str) -> Iterator[tuple[str, str, Json]]:
    on_reference = [s for s in campaign.shots if s.surface == REFERENCE]
    cell = calibrate(dataclasses.replace(campaign, shots=tuple(on_reference)), base)
    yield from _cell(cell.fit.parameters())
    sensor = cell.sensor
    observations: list[PairObservation] = []
    for shot in campaign.shots:
        if shot.surface != REFERENCE:
            alone = dataclasses.replace(campaign, shots=(shot,), sensor=sensor)
            single = fit_campaign(alone, base, by_pair=True, heldout=False)
            observations += observations_from_fit(single, shot=shot.name)
            for pair in single.pairs().values():
                yield "E* of one shot", f"{shot.sphere}/{shot.surface}", pair["reduced_modulus_Pa"]
    shared = {name: np.array(by) for name, by in cell.to_json()["inputs"].items()}
    network = adjust_moduli(
        observations, campaign.spheres, campaign.surfaces, sensor.covariance, {"": shared}
    ).to_json()
    yield from _moduli(network["moduli"])
    for name, pair in network["pairs"].items():
        yield "E* of a pair", name, pair["reduced_modulus_Pa"]


_CELL_KINDS = {
    "sensor.natural_frequency_Hz": "f0",
    "sensor.damping_ratio": "zeta",
    "sensor.gain_N_per_V": "S",
    "sensor.crystal_mass_kg": "M",
}


def _cell(parameters: Json) -> Iterator[tuple[str, str, Json]]:
    for name, kind in _CELL_KINDS.items():
        yield kind, "cell", parameters[name]


_MEASURANDS = {"E": "youngs_modulus_Pa", "E/(1-nu^2)": "plane_strain_modulus_Pa"}


def _moduli(moduli: Json) -> Iterator[tuple[str, str, Json]]:
    for key, entry in moduli.items():
        whose = "a reference" if entry["status"] == "reference" else "specimen"
        name = f"{entry['side']}s/{key.partition(':')[2] or key}"
        for letter, measurand in _MEASURANDS.items():
            if entry[measurand] is not None:
                yield f"{letter} of {whose}", name, entry[measurand]


def _true_value(truth: Json, kind: str, name: str) -> float:
    if kind.startswith("E*"):
        sphere, surface = name.split("/")
        sides = truth["spheres"][sphere], truth["surfaces"][surface]
        return 1 / sum(1 / float(side["plane_strain_modulus_Pa"]) for side in sides)
    measurand = _MEASURANDS.get(kind.partition(" of ")[0])
    if measurand is not None:
        side, material = name.split("/")
        return float(truth[side][material][measurand])
    cell = truth["sensor"]
    mass, k = cell["crystal_mass_kg"], cell["crystal_stiffness_N_per_m"]
    return float(
        {
            "f0": math.sqrt(k / mass) / (2 * math.pi),
            "zeta": cell["crystal_damping_N_s_per_m"] / (2 * math.sqrt(k * mass)),
            "S": k * cell["compliance_m_per_V"],
            "M": mass,
        }[kind]
    )


def run(
    campaigns: int, seed: int, *, workers: int = 1, rigs: Rigs | None = None
) -> Iterator[list[Pull]]:
    """Simulate and fit campaigns.

    Parameters
    ----------
    campaigns : int
        How many; half with white noise.
    seed : int
        Of the first one; the others follow.

    Yields
    ------
    list of Pull
        One campaign's.
    """
    seeds = range(1000 * seed, 1000 * seed + campaigns)
    if workers == 1:
        yield from (campaign_pulls(one, rigs) for one in seeds)
        return
    with ProcessPoolExecutor(workers) as pool:
        yield from pool.map(partial(campaign_pulls, rigs=rigs), seeds)


def coverage(pulls: Sequence[Pull], level: str) -> tuple[float, float]:
    """Return the share of intervals that hold the truth, and its standard uncertainty.

    Parameters
    ----------
    level : str
        ``68`` or ``95``.

    Returns
    -------
    tuple of float
        Quantities of one campaign share its calibration and its references, so campaigns are
        counted as independent, not intervals.
    """
    inside: dict[int, list[bool]] = defaultdict(list)
    for pull in pulls:
        inside[pull.campaign].append(abs(pull.score) <= LEVELS[level])
    hits = np.array([sum(x) for x in inside.values()], dtype=float)
    sizes = np.array([len(x) for x in inside.values()], dtype=float)
    share = float(hits.sum() / sizes.sum())
    spread = float(np.sqrt(np.sum((hits - share * sizes) ** 2)) / sizes.sum())
    return share, spread


def table(pulls: Iterable[Pull]) -> str:
    """Return the coverage as a Markdown table.

    Parameters
    ----------
    pulls : iterable of Pull
        Of all campaigns.

    Returns
    -------
    str
        One line per way and sort of quantity; ``!`` marks what is outside `ALLOWED`.
    """
    groups: dict[tuple[str, str], list[Pull]] = defaultdict(list)
    for pull in pulls:
        groups[pull.way, pull.kind].append(pull)
    noises = (None, "white", "coloured")
    heads = [f"{level} % {noise or 'all'}" for level in LEVELS for noise in noises]
    lines = [f"| way | quantity | intervals | {' | '.join(heads)} | mean | sd | median u |"]
    lines.append("|---" * (len(heads) + 6) + "|")
    for (way, kind), group in sorted(groups.items()):
        scores = np.array([p.score for p in group])
        held = [
            _held([p for p in group if noise in (None, p.noise)], level)
            for level in LEVELS
            for noise in noises
        ]
        u = float(np.median([p.u for p in group]))
        lines.append(
            f"| {way} | {kind} | {len(group)} | {' | '.join(held)} "
            f"| {scores.mean():+.2f} | {scores.std():.2f} | {100 * u:.2g} % |"
        )
    return "\n".join(lines)


def _held(group: Sequence[Pull], level: str) -> str:
    if not group:
        return "-"
    share, spread = coverage(group, level)
    return f"{100 * share:.1f} +- {100 * spread:.1f}{'' if _allowed(share, level) else ' !'}"


def _allowed(share: float, level: str) -> bool:
    low, high = ALLOWED[level]
    return low <= share <= high


def measure() -> list[Figure]:
    """Return the coverage of a small sample, as a benchmark among others.

    Returns
    -------
    list of Figure
        For the joint fit and the archive's way, all quantities together. The committed table has
        more campaigns and every quantity by itself.
    """
    pulls = [p for found in run(QUICK_CAMPAIGNS, SEED) for p in found]
    figures = []
    for way in ("joint", "archive"):
        share, spread = coverage([p for p in pulls if p.way == way], "95")
        figures.append(
            Figure(
                name=f"95 % intervals that hold the truth, {way}, {QUICK_CAMPAIGNS} campaigns",
                value=share,
                unit="1",
                reference=0.95,
                reference_name=f"+- {spread:.3f} by chance",
                ratio=share / 0.95,
                goal="0.92 .. 0.98",
                met=0.92 - 2 * spread <= share <= 0.98 + 2 * spread,
            )
        )
    return figures


def main() -> int:
    """Run the benchmark from the command line: ``python -m impactd.bench.coverage``."""
    blas_threads.keep_to_one()
    parser = argparse.ArgumentParser(prog="python -m impactd.bench.coverage")
    parser.add_argument("--campaigns", type=int, default=CAMPAIGNS)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--rig", choices=RIGS, default=DEFAULT_RIG, help="physics of the rigs")
    parser.add_argument("--labels", choices=SPREADS, default="exact", help="true radii and so on")
    parser.add_argument("--undeclared", action="store_true", help="leave their u out")
    parser.add_argument("--pulls", type=Path, help="also write every score here, as JSON lines")
    parser.add_argument("--table", type=Path, help="only print the table of such a file")
    options = parser.parse_args()
    if options.table is not None:
        lines = options.table.read_text().splitlines()
        print(table(Pull(**json.loads(line)) for line in lines))
        return 0
    pulls: list[Pull] = []
    out = options.pulls.open("w") if options.pulls else None
    rigs = Rigs(options.rig, options.labels, not options.undeclared)
    all_of_them = run(options.campaigns, options.seed, workers=options.workers, rigs=rigs)
    for done, found in enumerate(all_of_them, 1):
        pulls += found
        if out is not None:
            out.writelines(json.dumps(dataclasses.asdict(p)) + "\n" for p in found)
            out.flush()
        print(f"\r{done} of {options.campaigns} campaigns", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print(table(pulls))
    return 0


if __name__ == "__main__":
    sys.exit(main())
