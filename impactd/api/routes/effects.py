"""Effects: the library of what a measurement may hide."""

from __future__ import annotations

from fastapi import APIRouter

from impactd.api.finite import without_nan
from impactd.effect_list import effect_list
from impactd.wire.model_answers import EffectsAnswer

router = APIRouter(prefix="/v1/effects", tags=["models"])


@router.get("")
def list_effects() -> EffectsAnswer:
    """List the effects this version knows, with parameters, bounds, sources and validation."""
    return EffectsAnswer.model_validate({"items": without_nan(effect_list())})
