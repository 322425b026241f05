"""The effect library: every file of this folder that defines ``EFFECT``, found by looking."""

from __future__ import annotations

import importlib
import pkgutil
import warnings
from functools import cache
from typing import Any

from numba import njit
from numba.core.errors import NumbaExperimentalFeatureWarning
from numba.typed import List

import analysis.effects
from analysis.effects.effect import SLOTS, Effect
from analysis.effects.probe import PROBE_ID, probe_term
from analysis.errors import UnknownModelError


@cache
def library() -> dict[str, Effect]:
    """Return all effects by id, in the order of the slots.

    Returns
    -------
    dict of Effect
        By id.
    """
    found = []
    for module in pkgutil.iter_modules(analysis.effects.__path__):
        loaded = importlib.import_module(f"analysis.effects.{module.name}")
        effect = getattr(loaded, "EFFECT", None)
        if isinstance(effect, Effect):
            found.append(effect)
    found.sort(key=lambda e: (SLOTS.index(e.slot), e.id))
    return {effect.id: effect for effect in found}


def effect_named(name: str) -> Effect:
    """Return an effect by its id.

    Parameters
    ----------
    name : str
        E.g. ``coupler_highpass``, or a variant's, ``amplifier_lowpass:second_order``.

    Returns
    -------
    Effect
        The effect.

    Raises
    ------
    UnknownModelError
        If the library has no such effect; the message lists those it has.
    """
    known = {e.id: e for listed in library().values() for e in (listed, *listed.variants)}
    try:
        return known[name]
    except KeyError:
        raise UnknownModelError(
            f"There is no effect {name!r}; the library has {', '.join(known)}."
        ) from None


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


@njit(cache=True)
def _as_list(terms):  # type: ignore[no-untyped-def]
    # compiled once and kept on disk; numba's list filled from outside compiles anew in each process
    found = List()
    for term in terms:
        found.append(term)
    return found


@cache
def contact_terms() -> tuple[Any, dict[str, int]]:
    """Return all compiled contact terms, as numba's list, and each effect's place in it."""
    every = [e for listed in library().values() for e in (listed, *listed.variants)]
    having = [e for e in every if e.contact is not None]
    with warnings.catch_warnings():
        # functions as values are "experimental" in numba's words; the tests pin what is used
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        terms = _as_list((*(e.contact for e in having), probe_term))
    return terms, {PROBE_ID: len(having)} | {e.id: i for i, e in enumerate(having)}
