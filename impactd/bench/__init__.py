"""Benchmarks: each figure is a ratio to a reference measured in the same run.

A machine's speed says little, and a noisy one says it differently each time; a ratio to something
everybody knows, measured a second later on the same machine, can be compared.

Each benchmark is one module here with ``measure() -> list[Figure]``; ``runner.BENCHMARKS`` names
them in the order they run.
"""

from impactd.bench.figure import Figure
from impactd.bench.runner import run

__all__ = ["Figure", "run"]
