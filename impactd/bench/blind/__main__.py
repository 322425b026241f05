"""Blind trials from the command line: ``python -m impactd.bench.blind``."""

from __future__ import annotations

import argparse
import json
import signal
import sys
from pathlib import Path

from impactd import blas_threads

blas_threads.keep_to_one()  # before anything imports numpy

from drivers.simulated.rig_model import DEFAULT_RIG, RIGS  # noqa: E402 - see above
from impactd.bench.blind.outcome import outcome  # noqa: E402 - see above
from impactd.bench.blind.plan import KINDS  # noqa: E402 - see above
from impactd.bench.blind.runs import Task, read, run_into  # noqa: E402 - see above
from impactd.bench.blind.table import confusion, table  # noqa: E402 - see above
from impactd.bench.blind.trial import Trial  # noqa: E402 - see above


def main(arguments: list[str] | None = None) -> int:
    """Run trials into a file, or print the table of files.

    Parameters
    ----------
    arguments : list of str, optional
        Those of the command line by default.

    Returns
    -------
    int
        0; 2 for a file that cannot be read, 130 when stopped.
    """
    options = _options(arguments)
    try:
        if options.table:
            return _print(read(options.table), options.confusion)
        return _run(options)
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("\nStopped. The same command goes on from here.", file=sys.stderr)
        return 130


def _options(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m impactd.bench.blind", description=__doc__)
    parser.add_argument("--kind", nargs="+", choices=KINDS, default=KINDS, help="default: all")
    parser.add_argument("--rig", choices=RIGS, default=DEFAULT_RIG, help="physics of the rigs")
    parser.add_argument("--seed-from", type=int, help="seed of the first trial of each kind")
    parser.add_argument("--campaigns", type=int, help="trials of each kind")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--budget", type=float, help="how long each diagnosis may search [s]")
    parser.add_argument("--out", type=Path, help="JSON lines; what it holds is not run again")
    parser.add_argument("--table", type=Path, nargs="+", help="only print the table of such files")
    parser.add_argument("--confusion", type=Path, help="with --table: write who was taken for whom")
    options = parser.parse_args(arguments)
    needed = (options.seed_from, options.campaigns, options.out)
    if options.table is None and None in needed:
        parser.error("give --seed-from, --campaigns and --out to run trials, or --table to count")
    return options


def _run(options: argparse.Namespace) -> int:
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # else workers would be orphaned
    seeds = range(options.seed_from, options.seed_from + options.campaigns)
    tasks = [Task(kind, seed, options.rig) for seed in seeds for kind in options.kind]
    trials = run_into(options.out, tasks, workers=options.workers, budget_s=options.budget)
    for done, trial in enumerate(trials, 1):
        print(f"{done}: {_line(trial)}", file=sys.stderr, flush=True)
    return _print(read([options.out]), options.confusion)


def _line(trial: Trial) -> str:
    truth = "+".join(trial.truth) or "nothing"
    if not trial.was_simulated:
        return f"{trial.kind} {trial.seed}: {truth}: not simulated: {trial.error}"
    said = " ".join((trial.verdict, "+".join(trial.named)))
    if trial.set_aside:
        said += f", shots {', '.join(map(str, trial.set_aside))} set aside"
    seconds = "" if trial.seconds is None else f", {trial.seconds:.1f} s"
    visible = "" if trial.visible is None else f" ({trial.visible:.2g})"
    return f"{trial.kind} {trial.seed}: {truth}{visible}: {said}: {outcome(trial)}{seconds}" + (
        f": {trial.error}" if trial.error else ""
    )


def _print(trials: list[Trial], matrix: Path | None) -> int:
    print(table(trials))
    if matrix is not None:
        matrix.write_text(json.dumps(confusion(trials), indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
