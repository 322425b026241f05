"""Names of parameters are the keys of documents, carry their fields and are never taken apart."""

from __future__ import annotations

import ast
import copy
import dataclasses
import json
import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import analysis
from analysis.campaign import Campaign
from analysis.fit.problem import build
from analysis.model.impact_model import model_named
from analysis.parameters import (
    CELL,
    ParameterName,
    input_in_document,
    key_in_moduli,
    of_effect,
    of_input,
    of_law,
    of_material,
    of_pair,
    of_rebound,
    of_sensor,
)

EVERY = {
    "sensor.ln_S": (of_sensor("ln_S"), ("sensor", "", "ln_S", "")),
    "sphere.acetal": (of_material("sphere", "acetal"), ("sphere", "acetal", "ln_E", "")),
    "surface.type 2.1": (of_material("surface", "type 2.1"), ("surface", "type 2.1", "ln_E", "")),
    "pair.acetal/pvc": (of_pair("acetal/pvc"), ("pair", "acetal/pvc", "ln_K", "")),
    "rebound.seen_ms": (of_rebound("seen_ms"), ("rebound", "", "seen_ms", "")),
    "echo.delay_s": (of_effect("echo", "delay_s"), ("effect", "echo", "delay_s", "")),
    "echo.share[pvc]": (of_effect("echo", "share", "pvc"), ("effect", "echo", "share", "pvc")),
    "input.gravity": (of_input("gravity", None), ("input", "", "gravity", "")),
    "input.mass.a.b": (of_input("mass", "a.b"), ("input", "a.b", "mass", "")),
    "echo.size 0 [a/b]": (of_law("echo", "size 0", "a/b"), ("law", "echo", "size 0", "a/b")),
}
"""Every kind of name, with its kind, owner, quantity and group."""

TAKES_APART = {"partition", "rpartition", "split", "rsplit", "startswith", "endswith"}
TAKES_APART |= {"removeprefix", "removesuffix", "strip", "lstrip", "rstrip"}
KINDS = ("sensor", "sphere", "surface", "pair", "rebound", "input", "law")
BORDERS = {
    "parameters.py": "the key of a stated number in the document of a fit or calibration",
    "fit/conflicts.py": "where a campaign's document states a number",
    "diagnosis/document/residual.py": "labels of a discrepancy's coefficients",
}


@pytest.mark.parametrize("key", EVERY)
def test_a_name_is_its_key_and_carries_its_fields(key: str) -> None:
    """A name compares, sorts and serialises like the key of a document, and tells its fields."""
    name, fields = EVERY[key]
    assert name == key == name.key
    assert type(name.key) is str
    assert (name.kind, name.owner, name.quantity, name.group) == fields
    assert hash(name) == hash(key)
    assert [key].index(name) == [name].index(key) == 0
    assert json.dumps({name: [name]}) == json.dumps({key: [key]})


@pytest.mark.parametrize("key", EVERY)
def test_a_copied_name_keeps_its_fields(key: str) -> None:
    """Pickle, which carries fits between processes, and copies keep the fields."""
    name, fields = EVERY[key]
    for again in (pickle.loads(pickle.dumps(name)), copy.copy(name), copy.deepcopy(name)):
        assert again == key
        assert isinstance(again, ParameterName)
        assert (again.kind, again.owner, again.quantity, again.group) == fields


def test_names_sort_as_their_keys_do() -> None:
    """Sorted names stand in the order of their keys and are still names."""
    names = sorted(name for name, _ in EVERY.values())
    assert names == sorted(EVERY)
    assert all(isinstance(name, ParameterName) for name in names)


def test_a_name_does_not_change() -> None:
    """Nobody gives a name another owner."""
    with pytest.raises(dataclasses.FrozenInstanceError):
        of_pair("acetal/pvc").owner = "pvc"  # type: ignore[misc]


def test_an_effect_owns_its_numbers_of_every_group() -> None:
    """A number is an effect's whatever its group, and a material called as the effect is none."""
    name = of_effect("echo", "share", "pvc")
    assert name.is_of("echo")
    assert name.is_of("echo", "share")
    assert not name.is_of("echo", "delay_s")
    assert not of_material("sphere", "echo").is_of("echo")
    assert (name.short, of_effect("echo", "share").short) == ("share[pvc]", "share")


def test_moduli_are_called_by_their_material() -> None:
    """A material that is a sphere's and a surface's is preceded by its side, no other is."""
    sphere, surface, other = of_material("sphere", "a"), of_material("surface", "a"), of_pair("a")
    assert key_in_moduli(sphere, [sphere, other]) == "a"
    assert key_in_moduli(sphere, [sphere, surface]) == "sphere:a"
    assert [name.side for name in (sphere, surface)] == ["sphere", "surface"]
    assert [name.is_modulus for name in (sphere, surface, other)] == [True, True, False]


def test_a_stated_number_is_read_back_from_its_document() -> None:
    """The key of a stated number in a document leads to the name that was written."""
    for key in ("input.gravity", "input.mass.a.b"):
        again, name = input_in_document(key), EVERY[key][0]
        assert dataclasses.asdict(again) == dataclasses.asdict(name)


def test_every_global_of_a_problem_tells_its_fields(made: tuple[Any, Campaign]) -> None:
    """Built, freed and extended problems have names throughout, each with its kind."""
    problem = build(made[1], model_named("kv2+coupler_highpass"))
    assert all(isinstance(name, ParameterName) for name in problem.names)
    kinds = {name.kind for name in problem.names}
    assert kinds == {"sensor", "sphere", "surface", "rebound", "effect"}
    assert [name for name in problem.names if name.kind == "sensor"] == list(CELL)
    (tau,) = (name for name in problem.names if name.kind == "effect")
    assert tau.is_of("coupler_highpass", "time_constant_s")


def _strings(node: ast.expr) -> Iterator[str]:
    for one in ast.walk(node):
        if isinstance(one, ast.Constant) and isinstance(one.value, str):
            yield one.value


def _taken_apart(source: str) -> list[int]:
    """Return the lines that part a string at a name's separators or ask how it begins."""
    return [
        call.lineno
        for call in ast.walk(ast.parse(source))
        if isinstance(call, ast.Call)
        and isinstance(call.func, ast.Attribute)
        and call.func.attr in TAKES_APART
        and call.args
        and any(
            text in (".", "[", "]", " [", "[]") or text.startswith(tuple(f"{k}." for k in KINDS))
            for text in _strings(call.args[0])
        )
    ]


def test_no_module_takes_a_name_apart() -> None:
    """Whoever wants to know what a parameter is asks its fields."""
    root = Path(analysis.__path__[0])
    found = {
        path.relative_to(root).as_posix(): lines
        for path in sorted(root.rglob("*.py"))
        if (lines := _taken_apart(path.read_text(encoding="utf-8")))
    }
    assert found.keys() == BORDERS.keys(), found


def test_the_check_sees_what_it_is_for() -> None:
    """The check finds the ways in which names were once taken apart."""
    for line in (
        'name.partition(".")',
        'name.split("[", 1)',
        'name.startswith(("sphere.", "surface."))',
        'name.startswith(f"{effect.id}.")',
        'label.rpartition("[")',
    ):
        assert _taken_apart(line) == [1], line
