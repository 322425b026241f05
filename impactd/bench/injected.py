"""Effects added to recordings of others: whether they are named, and nothing else.

``python -m impactd.bench.injected --data FOLDER``: every folder in it with a ``campaign.json`` is
diagnosed as it is, and with each of four effects of drawn size put into all of its records:

=====================  ========================================================================
``coupler_highpass``   first order, time constant around 1 ms
``clipping``           at 50 to 75 % of the median peak
``mains_hum``          1 to 5 % of the median peak, 50 or 60 Hz, at a phase of its own in each;
                       where a record holds a period, less is a slope like any other
``amplifier_lowpass``  first order, cut-off at a tenth to a third of the sampling rate
=====================  ========================================================================

The filters are the digital ones of scipy, which the analysis does not use. An effect counts as
named where the verdict is identified, family or partial and its id, or one that it says cannot be
told from it, is among the names.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from impactd import blas_threads

blas_threads.keep_to_one()  # before anything imports numpy

import numpy as np  # noqa: E402 - see above
from scipy.signal import butter, lfilter, lfilter_zi  # noqa: E402 - see above

from analysis.aliases import Array  # noqa: E402 - see above
from analysis.campaign import Campaign, Shot  # noqa: E402 - see above
from analysis.diagnosis.procedure import diagnose_campaign  # noqa: E402 - see above
from analysis.diagnosis.progress import TimeBudget  # noqa: E402 - see above
from impactd.bench.blind.interval import wilson95  # noqa: E402 - see above
from impactd.diagnosis.working_time import working_time  # noqa: E402 - see above
from impactd.storage.campaign_folder import load_campaign  # noqa: E402 - see above

Change = Callable[[Array, float, np.random.Generator], Array]
"""A record over the median peak, its rest taken off, its rate and a source of chance."""

UNTOUCHED = ""
EFFECTS = ("coupler_highpass", "clipping", "mains_hum", "amplifier_lowpass")
MAINS_HZ = (50.0, 60.0)


@dataclass(frozen=True)
class Case:
    """One set with one effect, or none."""

    folder: str
    effect: str
    seed: int
    size: float = 0.0
    """Of a high-pass in seconds, of a low-pass over the sampling rate, else over the peak."""
    mains_hz: float = 50.0


@dataclass(frozen=True)
class Said:
    """What a diagnosis said of a case."""

    case: Case
    verdict: str
    names: tuple[str, ...]
    """Those named, and those that cannot be told from them."""
    set_aside: int
    seconds: float

    @property
    def is_right(self) -> bool:
        """Whether what was put in is named, or nothing where nothing was."""
        if self.case.effect == UNTOUCHED:
            return not self.names
        named = self.verdict in ("identified", "family", "partial")
        return named and self.case.effect in self.names


def drawn_cases(data: Path, seeds: range) -> Iterator[Case]:
    """Yield each set as it is, and for each seed with every effect that its records can hold."""
    folders = sorted(path.parent for path in data.glob("*/campaign.json"))
    for folder in folders:
        yield Case(str(folder), UNTOUCHED, 0)
    for seed in seeds:
        for place, folder in enumerate(folders):
            shortest_s = min(
                shot.signal.size / shot.sample_rate_hz for shot in load_campaign(folder).shots
            )
            rng = np.random.default_rng([seed, place])
            sizes = {
                "coupler_highpass": float(np.exp(rng.uniform(np.log(5e-4), np.log(2e-3)))),
                "clipping": float(rng.uniform(0.5, 0.75)),
                "mains_hum": float(np.exp(rng.uniform(np.log(0.01), np.log(0.05)))),
                "amplifier_lowpass": float(rng.uniform(1 / 10, 1 / 3)),
            }
            mains_hz = float(rng.choice(MAINS_HZ))
            for effect in EFFECTS:
                if effect != "mains_hum" or shortest_s * mains_hz >= 1.0:
                    yield Case(str(folder), effect, seed, sizes[effect], mains_hz)


def injected(campaign: Campaign, case: Case) -> Campaign:
    """Return a campaign with the effect of a case in every record."""
    if case.effect == UNTOUCHED:
        return campaign
    rng = np.random.default_rng([case.seed, 1])
    rests = [float(np.median(s.signal[: max(5, s.trigger_index // 2)])) for s in campaign.shots]
    heights = [np.abs(s.signal - rest).max() for s, rest in zip(campaign.shots, rests, strict=True)]
    peak = float(np.median(heights))

    def changed(shot: Shot, rest: float) -> Shot:
        """Return a shot with the effect in its record."""
        signal = _changed((shot.signal - rest) / peak, shot.sample_rate_hz, case, rng)
        return dataclasses.replace(shot, signal=rest + peak * signal)

    shots = tuple(changed(s, rest) for s, rest in zip(campaign.shots, rests, strict=True))
    return dataclasses.replace(campaign, shots=shots)


def _changed(x: Array, rate_hz: float, case: Case, rng: np.random.Generator) -> Array:
    if case.effect == "clipping":
        return np.clip(x, -case.size, case.size)
    if case.effect == "mains_hum":
        phase = rng.uniform(0.0, 2.0 * np.pi)
        angles = 2.0 * np.pi * case.mains_hz * np.arange(x.size) / rate_hz
        return np.asarray(x + case.size * np.sin(angles + phase))
    if case.effect == "coupler_highpass":
        return _filtered(x, *butter(1, 1.0 / (2.0 * np.pi * case.size), "high", fs=rate_hz))
    return _filtered(x, *butter(1, case.size * rate_hz, "low", fs=rate_hz))


def _filtered(x: Array, b: Array, a: Array) -> Array:
    """Return a filtered record; the filter has settled at its first sample."""
    return np.asarray(lfilter(b, a, x, zi=lfilter_zi(b, a) * x[0])[0])


def judge(case: Case, budget_s: float | None) -> Said:
    """Diagnose a case."""
    begin = time.perf_counter()
    budget = None if budget_s is None else TimeBudget(budget_s, working_time)
    found = diagnose_campaign(injected(load_campaign(case.folder), case), budget=budget)
    names = {*found.effect_ids, *found.confusable, *(one.id for one in found.mistakes)}
    took_s = time.perf_counter() - begin
    return Said(case, found.verdict, tuple(sorted(names)), len(found.set_aside), took_s)


def table(said: list[Said]) -> str:
    """Return how often what was put in was named, by effect and by set."""
    rows = ["| put in | " + " | ".join(folders := _folders(said)) + " | all |"]
    rows.append("|---" * (len(folders) + 2) + "|")
    for effect in (UNTOUCHED, *EFFECTS):
        own = [one for one in said if one.case.effect == effect]
        cells = [_share([o for o in own if Path(o.case.folder).name == f]) for f in folders]
        rows.append(f"| {effect or 'nothing'} | " + " | ".join([*cells, _share(own)]) + " |")
    put_in = [one for one in said if one.case.effect != UNTOUCHED]
    if put_in:
        low, high = wilson95(sum(one.is_right for one in put_in), len(put_in))
        rows.append(f"\nnamed in {_share(put_in)}, 95 % interval {low:.3f} to {high:.3f}")
    return "\n".join(rows)


def _folders(said: list[Said]) -> list[str]:
    return sorted({Path(one.case.folder).name for one in said})


def _share(said: list[Said]) -> str:
    return f"{sum(one.is_right for one in said)} of {len(said)}" if said else ""


def main(arguments: list[str] | None = None) -> int:
    """Judge all cases and print how often the effect was named; 2 where there are no recordings."""
    parser = argparse.ArgumentParser(prog="python -m impactd.bench.injected", description=__doc__)
    parser.add_argument("--data", type=Path, required=True, help="folder of campaign folders")
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--draws", type=int, default=3, help="of each effect in each set")
    parser.add_argument("--budget", type=float, help="how long each diagnosis may search [s]")
    parser.add_argument("--only", choices=("untouched", *EFFECTS), help="one kind alone")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", type=Path, help="one JSON line a case")
    options = parser.parse_args(arguments)
    seeds = range(options.seed_from, options.seed_from + options.draws)
    cases = list(drawn_cases(options.data, seeds))
    if options.only:
        wanted = UNTOUCHED if options.only == "untouched" else options.only
        cases = [case for case in cases if case.effect == wanted]
    if not cases:
        print(f"{options.data} holds no campaign folder.", file=sys.stderr)
        return 2
    said: list[Said] = []
    with ProcessPoolExecutor(options.workers) as pool:
        for one in pool.map(partial(judge, budget_s=options.budget), cases):
            said.append(one)
            print(f"{len(said)} of {len(cases)}: {_line(one)}", file=sys.stderr, flush=True)
            if options.json:
                with options.json.open("a") as lines:
                    lines.write(json.dumps(dataclasses.asdict(one)) + "\n")
    print(table(said))
    return 0


def _line(one: Said) -> str:
    case = one.case
    put_in = f"{case.effect} {case.size:.3g}" if case.effect else "nothing"
    named = " ".join(one.names) or "nothing named"
    right = "right" if one.is_right else "WRONG"
    aside = f", {one.set_aside} set aside" if one.set_aside else ""
    return (
        f"{Path(case.folder).name} + {put_in}: {one.verdict}, {named}{aside}: {right}, "
        f"{one.seconds:.0f} s"
    )


if __name__ == "__main__":
    sys.exit(main())
