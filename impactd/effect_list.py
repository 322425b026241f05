"""The effect library as a list for people and programs."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from analysis.effects.effect import Effect, EffectParameter


def effect_list() -> list[dict[str, Any]]:
    """Return every effect this version knows, in the order of the slots, JSON-ready.

    Each has id, slot, title, how it shows, source, validation, parameters with units, bounds and
    neutral value, what must be known to try it, other forms, and those that only a model's name
    asks for.
    """
    from analysis.effects.library import library

    return [_described(effect) for effect in library().values()]


def _described(effect: Effect) -> dict[str, Any]:
    return {
        "id": effect.id,
        "slot": effect.slot,
        "title": effect.title,
        "tell_tale": effect.tell_tale,
        "source": effect.source,
        "validation": effect.validation,
        "parameters": [_parameter(one) for one in effect.parameters],
        "free_sizes_per_shot": effect.basis_size,
        "needs": list(effect.needs),
        "bases": list(effect.bases),
        "replaces_base": effect.replaces_base or None,
        "by_name": effect.by_name,
        "variants": [_described(one) for one in effect.variants],
    }


def _parameter(parameter: EffectParameter) -> dict[str, Any]:
    return {
        "name": parameter.name,
        "unit": parameter.unit,
        "description": parameter.description,
        "belongs_to": parameter.scope,
        "low": parameter.low,
        "high": parameter.high,
        "neutral": {"linear": "0", "inverse": "infinity"}.get(parameter.form),
        "starts": list(parameter.starts),
    }
