"""The effect library: every file of this folder that defines ``EFFECT``."""

from __future__ import annotations

import difflib
import importlib
import pkgutil
from functools import cache

import analysis.effects
from analysis.effects.effect import SLOTS, Effect
from analysis.effects.probe import PROBE_ID, probe_term
from analysis.errors import UnknownModelError
from analysis.model.by_address import address_of


@cache
def library() -> dict[str, Effect]:
    """Return all effects by id, in the order of the slots."""
    found = []
    for module in pkgutil.iter_modules(analysis.effects.__path__):
        loaded = importlib.import_module(f"analysis.effects.{module.name}")
        effect = getattr(loaded, "EFFECT", None)
        if isinstance(effect, Effect):
            found.append(effect)
    found.sort(key=lambda e: (SLOTS.index(e.slot), e.id))
    return {effect.id: effect for effect in found}


def effect_named(name: str) -> Effect:
    """Return an effect by its id, else raise an UnknownModelError that names the nearest.

    E.g. ``coupler_highpass``, or a variant, ``amplifier_lowpass:second_order``.
    """
    known = {
        e.id: e
        for listed in library().values()
        for e in (listed, *listed.variants, *listed.lookalikes)
    }
    try:
        return known[name]
    except KeyError:
        near = difflib.get_close_matches(name, known, 1)
        meant = f" Did you mean {near[0]!r}?" if near else ""
        raise UnknownModelError(
            f"There is no effect {name!r}.{meant} `impactd effects` lists all."
        ) from None


@cache
def library_hooks() -> tuple[object, ...]:
    """Return the functions of all effects, each of which is itself and no copy."""
    effects = [e for one in library().values() for e in (one, *one.variants, *one.lookalikes)]
    return tuple(hook for e in effects for hook in e.hooks)


def library_table() -> str:
    """Return the library as a Markdown table, one row per effect and variant."""
    rows = [
        "| id | slot | what a real rig does | parameters (unit; belongs to) | how it shows |",
        "|---|---|---|---|---|",
    ]
    for listed in library().values():
        for effect in (listed, *listed.variants):
            numbers = ", ".join(f"`{p.name}` ({p.unit}; {p.scope})" for p in effect.parameters)
            if effect.basis_size:
                numbers = f"{effect.basis_size} free sizes per shot"
            row = (f"`{effect.id}`", effect.slot, effect.title, numbers, effect.tell_tale)
            rows.append(f"| {' | '.join(row)} |")
    return "\n".join(rows)


@cache
def term_addresses() -> dict[str, int]:
    """Return where the compiled contact term of each effect that has one is, by effect id."""
    every = [e for listed in library().values() for e in (listed, *listed.variants)]
    found = {e.id: address_of(e.contact) for e in every if e.contact is not None}
    return found | {PROBE_ID: address_of(probe_term)}
