"""The effects that acted beside those that were named, each number under one name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.effects.library import library
from analysis.written_numbers import measured
from impactd.aliases import Json

LIBRARY_NAMES = {
    ("clipping", "limit_v"): "ceiling_v",
    ("echo", "ratio"): "strength",
    ("viscoelastic_damping", "relaxation_s"): "dissipation_time_s",
}
"""Parameters that the simulated rig and the library name differently, by effect."""


@dataclass(frozen=True)
class ComparedEffect:
    """An effect that acted, was named, or both.

    Attributes
    ----------
    remark : str
        What a reader must know of it first; empty where it acted and was named.
    rows : list of tuple
        What, sealed, found, unit.
    """

    id: str
    remark: str
    rows: list[tuple[str, str, str, str]]


def compared_effects(truth: Json, named: Sequence[Json]) -> list[ComparedEffect]:
    """Return each effect with its numbers as sealed and as found.

    Parameters
    ----------
    truth : dict
        As the simulated rig unsealed it.
    named : sequence of dict
        ``effects`` of ``impactd-diagnosis/1``.
    """
    acted = {str(one["id"]): one for one in truth.get("effects") or []}
    said = {str(one["id"]): one for one in named}
    return [
        ComparedEffect(
            name, _remark(name, acted, said), _rows(truth, acted.get(name), said.get(name))
        )
        for name in acted | said
    ]


def _remark(name: str, acted: Json, said: Json) -> str:
    if name not in acted:
        return "named, and does not act"
    if name not in said:
        return "not named" if name in library() else "not named; the library does not have it"
    return ""


def _rows(truth: Json, acted: Json | None, said: Json | None) -> list[tuple[str, str, str, str]]:
    sealed, found = acted or {}, said or {}
    forms = sealed.get("form") or "-", found.get("form", "").partition(":")[2] or "-"
    rows = [
        ("slot", sealed.get("slot", "-"), found.get("slot", "-"), ""),
        ("acts on", _where(acted), _where_named(said), ""),
    ]
    if forms != ("-", "-"):
        rows.append(("form", *forms, ""))
    values = dict(_renamed(truth, sealed)) if acted else {}
    measurands = found.get("parameters", {})
    for name in dict.fromkeys([*values, *(key.partition("[")[0] for key in measurands)]):
        mine = {key: one for key, one in measurands.items() if key.partition("[")[0] == name}
        shown = [" ".join([measured(one, sign="±"), key[len(name) :]]) for key, one in mine.items()]
        rows.append(
            (
                name,
                f"{values[name]:.4g}" if name in values else "-",
                "; ".join(one.strip() for one in shown) or "-",
                next((one["unit"] for one in mine.values()), ""),
            )
        )
    return rows


def _renamed(truth: Json, effect: Json) -> list[tuple[str, float]]:
    """Return an effect's sealed numbers as the library names and defines them."""
    numbers = []
    for name, value in effect["parameters"].items():
        if (effect["id"], name) == ("base_compliance", "base_mass_kg"):
            ratio = truth["sensor"]["crystal_mass_kg"] / value
            numbers.append(("crystal_over_base_mass", ratio))
        else:
            numbers.append((LIBRARY_NAMES.get((effect["id"], name), name), value))
    return numbers


def _where(acted: Json | None) -> str:
    if acted is None:
        return "-"
    return _everything_or(
        [
            f"{side} {name}"
            for side, one in acted.get("scope", {}).items()
            for name in ([one] if isinstance(one, str) else one)
        ]
    )


def _where_named(said: Json | None) -> str:
    if said is None:
        return "-"
    only = said.get("acts_on") or {"kind": "", "names": []}
    return _everything_or([f"{only['kind']} {name}" for name in only["names"]])


def _everything_or(materials: list[str]) -> str:
    return ", ".join(sorted(materials)) or "everything"
