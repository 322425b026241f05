"""The effect library, as people and programs are shown it."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from typing import Any


def effect_list() -> list[dict[str, Any]]:
    """Return every effect this version knows.

    Returns
    -------
    list of dict
        JSON-ready: id, slot, parameters. Empty while the library is empty.
    """
    import analysis.effects

    library = getattr(analysis.effects, "LIBRARY", {})
    return [_described(effect) for effect in library.values()]


def _described(effect: Any) -> dict[str, Any]:
    if hasattr(effect, "to_json"):
        described: dict[str, Any] = effect.to_json()
        return described
    return {
        "id": str(effect.id),
        "slot": str(effect.slot),
        "title": str(getattr(effect, "title", "")),
    }
