"""The built manual, open to anybody who reaches the port; it holds no secret."""

from __future__ import annotations

from fastapi import APIRouter, Depends, Request, Response
from fastapi.responses import RedirectResponse

from impactd.api.problems import ProblemError
from impactd.api.routes import page
from impactd.guides.files import DOWNLOADS, FIRST, guide_files
from impactd.page.files import PageFile
from impactd.reports.charts import REPORT_POLICY

POLICY = page.POLICY.replace("form-action 'none'", "form-action 'self'")
"""As of the technician's page, and the field of the search may be sent to the manual."""

# Pages for people: the description of the API leaves them out.
router = APIRouter(prefix="/guides", include_in_schema=False)


@router.get("")
def first_page() -> Response:
    """Lead to the manual's first page."""
    _files()
    return RedirectResponse(f"/guides/{FIRST}")


def _sent_by_pages(
    v: str = "", q: str = "", check_keywords: str = "", area: str = "", highlight: str = ""
) -> None:
    """Name the query parameters of the site's own links and search; its scripts read them."""


@router.get("/{name:path}", dependencies=[Depends(_sent_by_pages)])
def guide_file(name: str, request: Request) -> Response:
    """Return one of the manual's files."""
    if not name:
        return first_page()
    found = _files().get(name)
    if found is None:
        raise ProblemError(
            "not-found", f"The manual has no file {name!r}.", remedy="Begin at /guides."
        )
    policy = REPORT_POLICY if name.startswith(DOWNLOADS) else POLICY
    return page.answer_file(found, request, policy)


def _files() -> dict[str, PageFile]:
    found = guide_files()
    if not found:
        raise ProblemError(
            "not-found",
            "The manual was not built with this installation.",
            remedy="Run `make docs` in a checkout of the repository, and install it from there. "
            "The same pages are Markdown files in impactd/guides.",
        )
    return found
