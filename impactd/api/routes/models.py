"""Models: which there are, and with which one results are reported."""

from __future__ import annotations

from fastapi import APIRouter

from impactd.api.diagnosis_schemas import ActiveModelBody
from impactd.api.security import TheCaller, TheDaemon
from impactd.wire.model_answers import ModelChoice, ModelItem, ModelsAnswer

router = APIRouter(prefix="/v1/models", tags=["models"])


@router.get("")
def list_models(daemon: TheDaemon) -> ModelsAnswer:
    """List base models and named ones, every version, and say which is active."""
    active = daemon.archive.models.active()
    version = daemon.archive.models.active_version()
    return ModelsAnswer(
        active=active,
        active_version=version,
        items=[
            ModelItem(**model, active=(model["name"], model["version"]) == (active, version))
            for model in daemon.models()
        ],
        history=[
            ModelChoice(name=name, since_utc=since)
            for name, since in daemon.archive.models.history()
        ],
    )


@router.put("/active")
def choose_model(body: ActiveModelBody, daemon: TheDaemon, caller: TheCaller) -> ModelsAnswer:
    """Choose the model that later fits use; earlier results keep theirs."""
    daemon.choose_model(body.name, version=body.version, by=caller.name)
    return list_models(daemon)
