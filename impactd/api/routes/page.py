"""The technician's page: its files, open to anybody who reaches the port.

They hold no secret; everything they show comes through the other routes, which ask who one is.
"""

from __future__ import annotations

from fastapi import APIRouter, Request, Response
from fastapi.responses import FileResponse, HTMLResponse

from impactd.api.problems import ProblemError
from impactd.page.files import PageFile, page_files

router = APIRouter(tags=["page"])

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' data:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
    )
)
"""Scripts, styles and answers from this daemon only; nothing inline, nothing evaluated."""


@router.get("/", response_class=HTMLResponse)
def index(request: Request) -> Response:
    """Show the technician's page."""
    return _answer("index.html", request)


@router.get("/docs", response_class=HTMLResponse)
def docs(request: Request) -> Response:
    """Show the description of the REST API, from this daemon alone."""
    return _answer("docs/index.html", request)


@router.get("/page/{folder}/{name}", response_class=Response)
def page_file(folder: str, name: str, request: Request) -> Response:
    """Return one of the page's files."""
    return _answer(f"{folder}/{name}", request)


def _answer(name: str, request: Request) -> Response:
    found = page_files().get(name)
    if found is None:
        raise ProblemError("not-found", f"The page has no file {name!r}.")
    return answer_file(found, request, POLICY)


def answer_file(found: PageFile, request: Request, policy: str) -> Response:
    """Return a file, or 304 to whoever has it already."""
    headers = {
        "ETag": found.etag,
        # Asked again each time, answered by 304: an update of the daemon shows at once.
        "Cache-Control": "no-cache",
        "Content-Security-Policy": policy,
    }
    if found.etag in request.headers.get("if-none-match", ""):
        return Response(status_code=304, headers=headers)
    return FileResponse(found.path, media_type=found.media_type, headers=headers)
