"""Health and metrics, for supervisors and dashboards."""

from __future__ import annotations

from typing import Any

from fastapi import APIRouter, Request, Response

from impactd.api.problems import ProblemError
from impactd.api.security import TheDaemon

router = APIRouter(tags=["health"])


@router.get("/healthz")
def healthz(daemon: TheDaemon) -> dict[str, Any]:
    """Answer 200 while the acquisition loop, the job runner and the database answer, else 503."""
    parts = daemon.liveness()
    if not all(parts.values()):
        dead = ", ".join(name for name, alive in parts.items() if not alive)
        raise ProblemError(
            "unavailable",
            f"Not answering: {dead}.",
            remedy="Restart the daemon; see `journalctl -u impactd`.",
            parts=parts,
        )
    return {"alive": True, "parts": parts}


@router.get("/readyz")
def readyz(daemon: TheDaemon) -> dict[str, Any]:
    """Answer 200 when a drop would be started now, else 503 with the sentence of the light."""
    status = daemon.status()
    if not status["ready"]:
        raise ProblemError("unavailable", str(status["sentence"]), state=status["state"])
    return {"ready": True, "sentence": status["sentence"]}


@router.get("/metrics", response_class=Response)
def metrics(request: Request) -> Response:
    """Prometheus metrics."""
    text, media_type = request.app.state.metrics.render()
    return Response(text, media_type=media_type)
