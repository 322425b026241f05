"""``impactd certificate``: a calibration as a certificate, and a load cell's certificate read."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from impactd.console.options import Config, Data, Json

app = typer.Typer(help="Write a calibration as a certificate (DCC), or read a load cell's.")


@app.command()
def write(  # noqa: PLR0917 - typer reads options from the parameters
    identifier: Annotated[
        str,
        typer.Option("--identifier", metavar="NUMBER", help="The certificate's unique number."),
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE.xml", help="A file that is not there yet.")
    ],
    calibration: Annotated[
        int | None,
        typer.Argument(min=1, help="Number of a calibration.", show_default="the current one"),
    ] = None,
    responsible: Annotated[
        str | None,
        typer.Option("--responsible", metavar="NAME", help="Who answers for it."),
    ] = None,
    role: Annotated[str | None, typer.Option("--role", help="That person's role.")] = None,
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Write a calibration of the load cell as a digital calibration certificate (DCC 3.3.0).

    Laboratory, customer and cell come from [certificate] and [sensor] of the settings.
    """
    from impactd.console import certificates

    certificates.write(
        calibration,
        out,
        identifier=identifier,
        responsible=responsible,
        role=role,
        config=config,
        data=data,
        as_json=as_json,
    )


@app.command()
def read(
    certificate: Annotated[Path, typer.Argument(metavar="FILE.xml", help="A load cell's DCC 3.x.")],
    quantity: Annotated[
        str | None,
        typer.Option("--quantity", metavar="NAME", help="The sensitivity, if there are several."),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option(
            "--campaign", metavar="CAMPAIGN", help="Write it as the cell's prior of this campaign."
        ),
    ] = None,
    replace: Annotated[
        bool, typer.Option("--replace", help="With --campaign: instead of what stands there.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Read a load cell's certificate, and print its lines for [sensor] of the settings."""
    from impactd.console import certificates

    certificates.read(
        certificate, quantity=quantity, campaign=campaign, replace=replace, as_json=as_json
    )
