"""``impactd sign-in-code``: a short code that signs a browser in."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from typing import Annotated
from urllib.parse import urlsplit

import typer

from impactd.console.options import Json, Url


def add_to(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(sign_in_code)


def sign_in_code(
    page: Annotated[
        str | None,
        typer.Option(
            "--page",
            metavar="URL",
            envvar="IMPACTD_PAGE_URL",
            help="Address of the page on the other device, e.g. of the proxy.",
            show_default="that of the daemon",
        ),
    ] = None,
    url: Url = None,
    as_json: Json = False,
) -> None:
    """Print a code that signs a browser in, once, in place of a token.

    The code is valid for five minutes and has the rights of the token in IMPACTD_TOKEN.
    """
    if page is not None and not _is_address(page):
        raise typer.BadParameter(
            f"--page {page} is no address of a page; one looks like https://rig.example"
        )
    from impactd.console import sign_in

    sign_in.run(page=page, url=url, as_json=as_json)


def _is_address(page: str) -> bool:
    try:
        parts = urlsplit(page)
    except ValueError:
        return False
    return parts.scheme in ("http", "https") and bool(parts.hostname)
