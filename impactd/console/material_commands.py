"""``impactd materials``: list, show, change and add spheres and coupons."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from impactd.console.options import Json, Url


class Role(StrEnum):
    """What a material is used as."""

    SPHERE = "sphere"
    SURFACE = "surface"


def add_to(app: typer.Typer) -> None:
    """Add this command."""
    app.command()(materials)


def materials(  # noqa: PLR0917 - the framework fills them by name
    role: Annotated[Role | None, typer.Argument(help="With a name: show or change it.")] = None,
    name: Annotated[str | None, typer.Argument(help="A sphere or surface.")] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="KEY=VALUE...",
            help=(
                "mass_kg=6.12e-4+-2e-7, reference=true, batch.grade=G200, source='balance 3'; an "
                "empty value removes the key."
            ),
        ),
    ] = None,
    copy_of: Annotated[
        str | None,
        typer.Option("--copy-of", metavar="NAME", help=("Start a new one as a copy of this.")),
    ] = None,
    note: Annotated[str, typer.Option("--note", help="Why; kept with who and when.")] = "",
    url: Url = None,
    as_json: Json = False,
) -> None:
    """List spheres and coupons, show one with its changes, or change it for all that comes.

    Stored fits stay as they are; `impactd refit` makes them anew.
    """
    from impactd.console import materials as console  # noqa: PLC0415 - when the command runs

    if role is None or name is None:
        if role is not None:
            raise typer.BadParameter(f"give the name of the {role.value}, or nothing to list all")
        console.list_all(url=url, as_json=as_json)
        return
    console.show_or_change(
        role.value,
        name,
        assignments or [],
        copy_of=copy_of,
        note=note,
        url=url,
        as_json=as_json,
    )
