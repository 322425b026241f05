"""``impactd token``: make, list and take back bearer tokens."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from impactd.console.options import Config, Data, Json, open_archive

app = typer.Typer(
    help="Make, list and revoke tokens.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class TokenScope(StrEnum):
    """What a token allows; each holds the ones before it."""

    READ = "read"
    OPERATE = "operate"
    ADMIN = "admin"


@app.command()
def create(  # noqa: PLR0917 - typer reads options from the parameters
    scope: Annotated[
        TokenScope,
        typer.Option("--scope", help=("read: look. operate: make drops. admin: everything.")),
    ],
    name: Annotated[str, typer.Option("--name", help="Whose it is; drops are owned by it.")] = "",
    days: Annotated[float | None, typer.Option("--days", min=0.0, help="Lifetime. [d]")] = None,
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Make a token and print it, once: only its hash is kept."""
    with open_archive(config, data) as archive:
        token, secret = archive.tokens.create(name or scope.value, scope.value, days)
    if as_json:
        from dataclasses import asdict

        from impactd.console.tables import print_json

        print_json({**asdict(token), "token": secret})
    else:
        print(secret)


@app.command("list")
def list_tokens(config: Config = None, data: Data = None, as_json: Json = False) -> None:
    """List tokens, never their secrets."""
    from dataclasses import asdict

    from impactd.console.tables import print_json, table

    with open_archive(config, data) as archive:
        tokens = [asdict(token) for token in archive.tokens.list()]
    if as_json:
        print_json(tokens)
        return
    headings = ("id", "name", "scope", "created", "expires", "revoked")
    print(table(headings, [tuple(token.values()) for token in tokens]))


@app.command()
def revoke(
    number: Annotated[int, typer.Argument(help="Its id in `impactd token list`.")],
    config: Config = None,
    data: Data = None,
    as_json: Json = False,
) -> None:
    """Take a token back, at once."""
    with open_archive(config, data) as archive:
        token = archive.tokens.revoke(number)
    if as_json:
        from dataclasses import asdict

        from impactd.console.tables import print_json

        print_json(asdict(token))
        return
    print(f"Token {token.id} ({token.name}, {token.scope}) is revoked.")
