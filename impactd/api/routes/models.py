"""Models: which there are, and with which one results are reported."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter

from impactd.api.schemas import ActiveModelBody
from impactd.api.security import TheCaller, TheDaemon

router = APIRouter(prefix="/v1/models", tags=["models"])


@router.get("")
def list_models(daemon: TheDaemon) -> dict[str, Any]:
    """List the base models and name the active one."""
    active = daemon.archive.models.active()
    return {
        "active": active,
        "items": [{**model, "active": model["name"] == active} for model in daemon.models()],
        "history": [
            {"name": name, "since_utc": since} for name, since in daemon.archive.models.history()
        ],
    }


@router.put("/active")
def choose_model(body: ActiveModelBody, daemon: TheDaemon, caller: TheCaller) -> dict[str, Any]:
    """Choose the model that new results are reported with."""
    daemon.choose_model(body.name, by=caller.name)
    return list_models(daemon)
