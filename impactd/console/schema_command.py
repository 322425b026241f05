"""The command that prints the schemas of results."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from impactd.console.options import Json


class Schema(StrEnum):
    """What has a schema."""

    CAMPAIGN = "campaign"
    FIT = "fit"
    BUDGET = "budget"
    DIAGNOSIS = "diagnosis"
    EVENT = "event"
    SETTINGS = "settings"


def add_to(app: typer.Typer) -> None:
    """Add this command."""
    app.command()(schema)


def schema(
    name: Annotated[Schema, typer.Argument(help="Of what.")],
    as_json: Json = False,
) -> None:
    """Print the JSON Schema of what is exchanged.

    A campaign, a fit, a budget, a diagnosis, an event as bridges send it, or the settings.
    """
    import json
    from importlib import resources

    from impactd.console.tables import print_json

    del as_json  # a schema is JSON in any case
    if name is Schema.SETTINGS:
        from impactd.settings.settings import json_schema

        print_json(json_schema())
        return
    text = resources.files("impactd.schemas").joinpath(f"{name.value}.json").read_text("utf-8")
    print_json(json.loads(text))
