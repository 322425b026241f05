"""The thresholds of a diagnosis stand in one place, and its method's page names what exists."""

from __future__ import annotations

import ast
import dataclasses
import re
from pathlib import Path

import pytest

import analysis.diagnosis.criteria as criteria_module
from analysis.diagnosis.criteria import CRITERIA, Criteria

FOLDER = Path(criteria_module.__file__).parent
MODULES = sorted(p for p in FOLDER.rglob("*.py") if p.name != "criteria.py")
PAGE = (FOLDER / "METHOD.md").read_text(encoding="utf-8")
ORIGINS = ("Rate.", "Derived: ", "Measured: ", "Scale", "Chosen by trial")
MOST_THRESHOLDS = 30
"""What one person can keep in mind and question; one more needs another to go."""

COMPARED_BUT_NO_THRESHOLDS = {
    "progress.SEARCH_SHARE": "how a budget of time is shared out",
    "fit.AGREED": "when a search has converged",
    "mean_waveform.AGREED": "when a search has converged",
    "mean_waveform.SETTLED": "when a search has converged",
    "time_course.OUTLINE_FINE_UNTIL": "the knots of a basis",
    "time_course.0.5": "where a basis has enough samples to be looked for",
    "linear_filter.IMPULSE_EVEN_US": "the knots of a basis",
    "linear_filter.IMPULSE_UNTIL_US": "the knots of a basis",
    "linear_filter.LARGEST_SHARE": "the highest frequency that a basis has",
    "groupings.LEAST_INFORMATION": "rounding: the rank of a matrix",
    "proposals.RUN_AWAY": "rounding: squares that overflow",
    "roll_off.HIGHEST": "the range that a search goes over",
    "roll_off.0.99": "the range that a search goes over",
    "roll_off.1.01": "the range that a search goes over",
    "model_free.CONTACT_ENDS": "where a phase of a record begins",
    "model_free.WIDER": "where a pulse's width is taken",
    "model_free.DEEPEST": "where a pulse's width is taken",
    "mistakes.LEAST_SEEN": "rounding: the rank of a matrix",
    "repetitions.FURTHEST": "the range that a search goes over",
    "residual.0.05": "where a phase of a record begins",
    "residual.RING_ENDS": "where a phase of a record ends",
    "residual.10.0": "the bins of a picture",
    "wording.1000.0": "how a frequency is written",
    "multistart.RISES_AFTER": "the shape of a pulse, for a start",
}
"""Real numbers that stand in a comparison, and what they are instead."""
ROUNDING_OR_CONVERSION = {0.0, 1.0, 1e-300, 0.6745}
"""Literals of any module: the last turns a median of absolute deviations into a standard one."""


def _texts() -> dict[str, str]:
    """Return the text below each threshold."""
    source = ast.parse(Path(criteria_module.__file__).read_text(encoding="utf-8"))
    (node,) = [n for n in source.body if isinstance(n, ast.ClassDef) and n.name == "Criteria"]
    found = {}
    for one, after in zip(node.body, [*node.body[1:], None], strict=True):
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name):
            text = ""
            if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant):
                text = " ".join(str(after.value.value).split())
            found[one.target.id] = text
    return found


def _is_real(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, float)


def _named(tree: ast.Module) -> set[str]:
    """Return the names of a module's own real numbers, several in a line among them."""
    found = set()
    for node in tree.body:
        if isinstance(node, ast.Assign):
            target, value = node.targets[0], node.value
            pairs = [(target, value)]
            if isinstance(target, ast.Tuple) and isinstance(value, ast.Tuple):
                pairs = list(zip(target.elts, value.elts, strict=True))
            for name, number in pairs:
                if isinstance(name, ast.Name) and _is_real(number):
                    found.add(name.id)
    return found


def _compared(module: Path) -> set[str]:
    """Return the real numbers that a module compares something with, by name or as they stand."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    named, found = _named(tree), set()
    compared = [node for node in ast.walk(tree) if isinstance(node, ast.Compare)]
    for part in [part for node in compared for part in ast.walk(node)]:
        if isinstance(part, ast.Name) and part.id in named:
            found.add(f"{module.stem}.{part.id}")
        elif _is_real(part) and part.value not in ROUNDING_OR_CONVERSION:
            found.add(f"{module.stem}.{part.value}")
    return found


def test_no_threshold_can_be_changed_at_run_time():
    """Two parts of one diagnosis can never decide by different numbers."""
    for field in dataclasses.fields(Criteria):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(CRITERIA, field.name, 0.0)


def test_thresholds_are_few_and_each_says_where_it_comes_from():
    """A rate, a derivation, a measurement, a scale, or plainly a trial: one of these, once."""
    texts = _texts()
    assert set(texts) == {field.name for field in dataclasses.fields(Criteria)}
    assert len(texts) <= MOST_THRESHOLDS
    without = [name for name, text in texts.items() if sum(o in text for o in ORIGINS) != 1]
    assert not without


def test_every_threshold_decides_something():
    """One that no module reads is taken out."""
    used = "\n".join(module.read_text(encoding="utf-8") for module in MODULES)
    unused = [name for name in _texts() if not re.search(rf"\bCRITERIA\.{name}\b", used)]
    assert not unused


def test_no_module_compares_with_a_number_of_its_own():
    """What is left is listed with what it is: a basis, a picture, rounding, the end of a search."""
    found = set().union(*(_compared(module) for module in MODULES))
    assert found == set(COMPARED_BUT_NO_THRESHOLDS)


def _defined(path: Path) -> set[str]:
    """Return a file's functions and classes, and its classes' methods as ``Class.method``."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            found.add(node.name)
        if isinstance(node, ast.ClassDef):
            own = [n for n in node.body if isinstance(n, ast.FunctionDef)]
            found |= {f"{node.name}.{method.name}" for method in own}
    return found


@pytest.mark.parametrize("place", sorted(set(re.findall(r"`([\w./]+\.py(?:::[\w.]+)?)`", PAGE))))
def test_the_page_of_the_method_names_what_exists(place):
    """Every file and function that METHOD.md sends a reader to is there."""
    file, _, function = place.partition("::")
    assert (FOLDER / file).is_file()
    assert not function or function in _defined(FOLDER / file)


def test_the_page_of_the_method_names_thresholds_that_there_are():
    """And no others."""
    named = set(re.findall(r"\*([a-z]+_[a-z_]+)\*", PAGE))
    assert named
    assert named <= set(_texts())
