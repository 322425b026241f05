"""The benchmarks run, say what they measured, and refuse what they do not know."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from impactd.bench import Figure, run
from impactd.bench.solver import IMPACTS, SAMPLES, compiled_trace, relative_error


def test_an_unknown_benchmark_is_refused_with_those_there_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A misspelt name ends with code 2 and the names that would have worked."""
    assert run(None, ["sovler"]) == 2
    assert "solver, stream, store" in capsys.readouterr().err


def test_a_benchmark_that_cannot_run_does_not_hide_the_others(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One failure is told on stderr, the other benchmark's figures are printed and written."""
    figure = Figure("trace", 2e-5, "s", 2e-2, "scipy", 1000.0, ">= 500", met=True)

    def broken() -> list[Figure]:
        raise OSError("no space")

    monkeypatch.setattr("impactd.bench.solver.measure", broken)
    monkeypatch.setattr("impactd.bench.runner.BENCHMARKS", ("solver", "fast"))
    module = type("fast", (), {"measure": staticmethod(lambda: [figure])})
    monkeypatch.setitem(sys.modules, "impactd.bench.fast", module)
    out = tmp_path / "bench.json"
    assert run(out) == 1
    shown = capsys.readouterr()
    assert "no space" in shown.err
    assert "20 us" in shown.out
    document = json.loads(out.read_text())
    assert document["format"] == "impactd-bench/1"
    assert document["figures"]["fast"][0]["ratio"] == 1000.0


def test_json_without_a_file_is_all_that_is_printed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A comparison of arrays is a truth of NumPy's, which JSON does not know."""
    met = np.float64(1e3) > 500.0
    figure = Figure("trace", np.float64(2e-5), "s", 2e-2, "scipy", 1000.0, ">= 500", met=met)
    module = type("fast", (), {"measure": staticmethod(lambda: [figure])})
    monkeypatch.setitem(sys.modules, "impactd.bench.fast", module)
    monkeypatch.setattr("impactd.bench.runner.BENCHMARKS", ("fast",))
    assert run(Path("-")) == 0
    (found,) = json.loads(capsys.readouterr().out)["figures"]["fast"]
    assert (found["value"], found["met"]) == (2e-5, True)


@pytest.mark.parametrize("impact", IMPACTS, ids=lambda impact: impact.name)
def test_both_solvers_compute_the_same_trace(impact) -> None:  # type: ignore[no-untyped-def]
    """The compiled trace follows the reference to 1e-5 of its peak; the goal is 1e-6."""
    assert compiled_trace(impact).shape == (SAMPLES,)
    assert relative_error(impact) < 1e-5
