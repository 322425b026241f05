"""Effects: the library of what a measurement may hide."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from impactd.effect_list import effect_list

router = APIRouter(prefix="/v1/effects", tags=["models"])


@router.get("")
def list_effects() -> dict[str, Any]:
    """List the effects this version knows, with parameters, bounds, sources and validation."""
    return {"items": effect_list()}
