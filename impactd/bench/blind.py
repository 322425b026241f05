"""Blind trials of the loop: the simulator draws and seals, the analysis diagnoses, both are opened.

The diagnosis sees what a campaign folder holds and nothing else. Trials are numbered by one seed; a
table belongs to the seeds it was made with, so tune on some and report on others.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass

import numpy as np

from drivers.simulated.campaign import CampaignSettings
from drivers.simulated.draw import draw_effect
from drivers.simulated.effects import INVENTED, LIBRARY, Effect
from drivers.simulated.noise import NoiseSettings
from impactd.bench.figure import Figure
from impactd.bench.simulated_campaign import simulated_campaign

TRIALS = 40
FIRST_SEED = 90_000
"""Seeds of `measure`; the page's table names its own."""
KINDS = ("clean", "library", "outside", "pair")
SHARES = (0.2, 0.45, 0.2, 0.15)
VISIBLE = 400.0
"""Whitened squares of a residual from which an effect counts as detectable: 20 in norm."""


@dataclass(frozen=True)
class Trial:
    """One campaign, the truth and the verdict.

    Attributes
    ----------
    seed : int
        Of everything drawn.
    kind : str
        One of `KINDS`.
    truth : list of str
        Ids that acted.
    slots : list of str
        Their slots.
    ar1 : float
        Colour of the noise. [1]
    verdict : str
        Of the diagnosis.
    named, confusable : list of str
        Ids it gave.
    slot : str or None
        Where it put the discrepancy.
    p_value : float
        Of structure in the base model's residual.
    visible : float
        Whitened squares that the best model found takes away. [1]
    noise_ratio : float
        Held-out residual after the repair over the noise. [1]
    seconds : float
        Of the diagnosis, on a machine that was not idle. [s]
    """

    seed: int
    kind: str
    truth: list[str]
    slots: list[str]
    ar1: float
    verdict: str
    named: list[str]
    confusable: list[str]
    slot: str | None
    p_value: float
    visible: float
    noise_ratio: float
    seconds: float


def _draw(rng: np.random.Generator, kind: str) -> tuple[Effect, ...]:
    """Return what acts in one trial."""
    wanted = {"clean": 0, "library": 1, "outside": 1, "pair": 2}[kind]
    pool = INVENTED if kind == "outside" else LIBRARY
    found: list[Effect] = []
    while len(found) < wanted:
        effect = draw_effect(rng)
        if effect.id in pool and all(effect.slot != e.slot for e in found):
            found.append(effect)
    return tuple(found)


def trial(seed: int) -> Trial:
    """Draw, simulate, diagnose and compare one campaign.

    Parameters
    ----------
    seed : int
        Of everything drawn.

    Returns
    -------
    Trial
        With both sides.
    """
    import time  # noqa: PLC0415 - this is the benchmark's clock, not the analysis'

    from analysis.discovery.diagnosis import diagnose_campaign  # noqa: PLC0415 - in the worker

    rng = np.random.default_rng([seed, 7])
    kind = str(rng.choice(KINDS, p=SHARES))
    effects = _draw(rng, kind)
    ar1 = float(rng.choice([0.0, 0.3, 0.6]))
    noise = NoiseSettings(rms_v=float(np.exp(rng.uniform(np.log(1e-3), np.log(3e-3)))), ar1=ar1,
                          pink_corner_hz=0.0)  # fmt: skip
    campaign = simulated_campaign(CampaignSettings(effects=effects, noise=noise), seed)
    start = time.perf_counter()
    found = diagnose_campaign(campaign)
    seconds = time.perf_counter() - start
    first, last = found.steps[0], found.steps[-1]
    used = sum(s.white.size for s in last.evidence.shots)
    return Trial(
        seed,
        kind,
        [e.id for e in effects],
        [e.slot for e in effects],
        ar1,
        found.verdict,
        [r.owner for r in found.chosen],
        list(found.confusable),
        found.slot,
        first.omnibus.p_value,
        max(a.gain - a.dof for a in first.omnibus.answers.values()),
        math.sqrt(last.evidence.chi2 / used),
        seconds,
    )


def trials(seeds: list[int], *, workers: int | None = None) -> Iterator[Trial]:
    """Yield trials as they end, in order of their seeds.

    Parameters
    ----------
    seeds : list of int
        Which.
    workers : int, optional
        Processes; by default one a core.

    Yields
    ------
    Trial
        One a seed.
    """
    with ProcessPoolExecutor(workers or os.cpu_count()) as pool:
        yield from pool.map(trial, seeds)


def right(result: Trial) -> bool:
    """Tell whether all that acted was named, or is in the family that was named."""
    given = set(result.named) | set(result.confusable)
    return bool(result.named) and set(result.truth) <= given


def wrong(result: Trial) -> bool:
    """Tell whether a name was given with certainty that did not act."""
    if result.verdict not in ("identified", "partial"):
        return False
    return any(name not in result.truth for name in result.named)


def summary(results: list[Trial]) -> list[Figure]:
    """Return the shares that matter.

    Parameters
    ----------
    results : list of Trial
        Any number.

    Returns
    -------
    list of Figure
        One a question, with the goal of the trial.
    """
    clean = [r for r in results if r.kind == "clean"]
    seen = [r for r in results if r.kind != "clean" and r.visible >= VISIBLE]
    single = [r for r in seen if r.kind == "library"]
    outside = [r for r in seen if r.kind == "outside"]
    pairs = [r for r in seen if r.kind == "pair"]
    rows: list[tuple[str, list[Trial], Callable[[Trial], bool], str]] = [
        ("clean campaigns called discrepant", clean, lambda r: r.verdict != "adequate", "<= 0.01"),
        ("detectable effects detected", seen, lambda r: r.verdict != "adequate", ">= 0.98"),
        ("single effects: right name or family", single, right, ">= 0.95"),
        ("single effects: wrong name", single, wrong, "<= 0.02"),
        ("outside the library: unknown or partial", outside,
         lambda r: r.verdict in ("unknown", "partial"), ">= 0.9"),
        ("outside the library: identified", outside, lambda r: r.verdict == "identified", "<= 0"),
        ("outside the library: right slot", outside, lambda r: r.slot in r.slots, ">= 0.8"),
        ("two effects: both named", pairs, right, ">= 0.8"),
    ]  # fmt: skip
    found = []
    for name, group, test, goal in rows:
        if not group:
            continue
        share = float(np.mean([test(r) for r in group]))
        limit = float(goal.split()[1])
        met = share >= limit if goal.startswith(">") else share <= limit
        found.append(Figure(f"{name} ({len(group)})", share, "1", goal=goal, met=met))
    return found


def measure() -> list[Figure]:
    """Run the trials of `FIRST_SEED` and count.

    Returns
    -------
    list of Figure
        As `summary` makes them.
    """
    return summary(list(trials([FIRST_SEED + i for i in range(TRIALS)])))


def to_json(results: list[Trial]) -> list[dict[str, object]]:
    """Return trials as JSON-ready rows.

    Parameters
    ----------
    results : list of Trial
        Any number.

    Returns
    -------
    list of dict
        One a trial.
    """
    return [asdict(r) for r in results]
