"""The slots that are given to effects from outside the library, judged and counted.

Only the base model is fitted and every family of columns asked, to first order: seconds a campaign,
where a whole diagnosis takes minutes. What a diagnosis learns beyond first order is left out.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial

from impactd import blas_threads

blas_threads.keep_to_one()  # before anything imports numpy

from analysis.diagnosis.criteria import CRITERIA  # noqa: E402 - see above
from analysis.diagnosis.linearised import linearise  # noqa: E402 - see above
from analysis.diagnosis.localisation import (  # noqa: E402 - see above
    FAMILIES,
    gains_by_family,
    slot_probabilities,
)
from analysis.fit import joint  # noqa: E402 - see above
from analysis.fit.problem import build  # noqa: E402 - see above
from analysis.fit.start import with_start  # noqa: E402 - see above
from analysis.model.impact_model import model_named  # noqa: E402 - see above
from drivers.simulated.rig_model import RIGS  # noqa: E402 - see above
from impactd.bench.blind.interval import wilson95  # noqa: E402 - see above
from impactd.bench.blind.plan import draw_plan  # noqa: E402 - see above
from impactd.bench.simulated_campaign import simulated_campaign  # noqa: E402 - see above

VISIBLE = 200.0
"""Whitened squares of the best family, coefficients paid for, from which a campaign counts. A
choice: twenty times what chance brings to one of all families, so that it moves the odds little."""
LEVELS = 5
"""Groups of stated probabilities, equally wide. Derived: five slots have 0.2 each by chance, which
ends the first group."""


@dataclass(frozen=True)
class Judged:
    """One campaign.

    Attributes
    ----------
    squares : float
        Whitened squares that the best family explains, coefficients paid for.
    """

    effect: str
    slot: str
    squares: float
    odds: dict[str, float]

    @property
    def named(self) -> list[str]:
        """The slots of a verdict: the likeliest, and those that it cannot exclude."""
        least = CRITERIA.named_beside * max(self.odds.values())
        return [slot for slot, p in self.odds.items() if p >= least]


def judge(seed: int, rig: str) -> Judged:
    """Draw a campaign with one effect that no library knows, and ask where it lives."""
    plan = draw_plan("outside", seed, rig)
    problem = build(simulated_campaign(plan.settings, plan.campaign_seed), model_named(plan.base))
    problem, nuisances = with_start(problem)
    fitted = joint.fit(problem, nuisances)
    linearised = linearise(problem, fitted, wanted=FAMILIES)
    gains, effect = gains_by_family(linearised), plan.effects[0]
    odds = slot_probabilities(linearised, gains)
    return Judged(effect.id, effect.slot, max(gains.values()), odds)


def table(judged: Sequence[Judged]) -> str:
    """Return the shares that were right, with their 95 % intervals."""
    seen = [j for j in judged if j.squares >= VISIBLE]
    alone = [j for j in seen if len(j.named) == 1]
    likeliest = [j for j in seen if j.odds[j.slot] == max(j.odds.values())]
    rows = [
        ("the likeliest, or as likely", len(likeliest), len(seen)),
        ("among those named", sum(j.slot in j.named for j in seen), len(seen)),
        ("right where one is named alone", sum(j.slot in j.named for j in alone), len(alone)),
    ]
    kinds = len({j.effect for j in seen})
    lines = [f"{len(judged)} campaigns, {len(seen)} visible, {kinds} kinds", ""]
    for name, right, count in rows:
        if count:
            low, high = wilson95(right, count)
            lines.append(f"{name}: {right} of {count}, {low:.2f} .. {high:.2f}")
    if seen:
        named = sum(len(j.named) for j in seen) / len(seen)
        lines.append(f"slots named: {named:.1f} of {len(seen[0].odds)}, mean")
    lines += ["", "| stated probability, mean | how often true | of |", "|---|---|---|"]
    stated = [(p, slot == j.slot) for j in seen for slot, p in j.odds.items()]
    for level in range(LEVELS):
        some = [(p, true) for p, true in stated if min(int(p * LEVELS), LEVELS - 1) == level]
        if some:
            p, true = (sum(column) / len(some) for column in zip(*some, strict=True))
            lines.append(f"| {p:.2f} | {true:.2f} | {len(some)} |")
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Judge campaigns and print how often the slot was right."""
    parser = argparse.ArgumentParser(prog="python -m impactd.bench.slots", description=__doc__)
    parser.add_argument("--campaigns", type=int, default=200)
    parser.add_argument("--seed-from", type=int, required=True)
    parser.add_argument("--rig", choices=RIGS, default="closed")
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args(arguments)
    seeds = range(options.seed_from, options.seed_from + options.campaigns)
    judged: list[Judged] = []
    with ProcessPoolExecutor(options.workers) as pool:
        for found in pool.map(partial(judge, rig=options.rig), seeds):
            judged.append(found)
            said = ", ".join(f"{slot} {p:.2f}" for slot, p in found.odds.items())
            told = f"{found.effect} ({found.slot}, {found.squares:.2g}): {said}"
            print(f"{len(judged)}: {told}", file=sys.stderr, flush=True)
    print(table(judged))
    return 0


if __name__ == "__main__":
    sys.exit(main())
