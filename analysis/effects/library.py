"""The effect library: every file of this folder that defines ``EFFECT``, found by looking."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import Any

from numba import types
from numba.typed import List

import analysis.effects
from analysis.effects.effect import SLOTS, Effect
from analysis.errors import UnknownModelError
from analysis.model.effect_solver import TERM


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
        E.g. ``coupler_highpass``.

    Returns
    -------
    Effect
        The effect.

    Raises
    ------
    UnknownModelError
        If the library has no such effect; the message lists those it has.
    """
    try:
        return library()[name]
    except KeyError:
        raise UnknownModelError(
            f"There is no effect {name!r}; the library has {', '.join(library())}."
        ) from None


@cache
def contact_terms() -> tuple[Any, dict[str, int]]:
    """Return all compiled contact terms, as numba's list, and each effect's place in it."""
    having = [e for e in library().values() if e.contact is not None]
    terms = List.empty_list(types.FunctionType(TERM))
    for effect in having:
        terms.append(effect.contact)
    return terms, {e.id: i for i, e in enumerate(having)}
