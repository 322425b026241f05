"""Commands that run something here: serve, make-safe, demo, bench, doctor."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from impactd.console import completions
from impactd.console.options import Config, Data, Json, JsonCommand, JsonOut, settings_of

# A daemon that ends holds the port until its last words are out, and a board that was reset takes a
# second or two to come back on the bus. A third of the unit's TimeoutStopSec; the most that may be
# asked for is two thirds.
MAKE_SAFE_WAIT_S = 10.0


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    for command in (serve, make_safe, demo, doctor):
        app.command()(command)
    app.command(cls=JsonCommand)(bench)


def serve(
    config: Config = None,
    data: Data = None,
    host: Annotated[str | None, typer.Option("--host", help="Address to listen on.")] = None,
    port: Annotated[
        int | None, typer.Option("--port", min=0, max=65535, help="TCP port; 0 takes a free one.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print address and process as JSON once it listens.")
    ] = False,
) -> None:
    """Run the daemon until it is told to stop."""
    settings = settings_of(config, data)
    given = {name: value for name, value in (("host", host), ("port", port)) if value is not None}
    server = settings.server.model_copy(update=given)
    from impactd.data_lock import DataLock

    # The daemon locks for itself; asking first refuses at once, before anything heavy is loaded.
    DataLock(settings.storage.directory).release()
    from impactd.api.own_commands import own_options
    from impactd.server import serve as run

    run(
        settings.model_copy(update={"server": server}),
        announce=_announce if as_json else None,
        own_options=own_options(config, data),
    )


def _announce(url: str) -> None:
    print(json.dumps({"url": url, "pid": os.getpid()}), flush=True)


def make_safe(
    config: Config = None,
    wait: Annotated[
        float,
        typer.Option(
            "--wait", min=0.0, max=20.0, help="Ask a board that does not answer again. [s]"
        ),
    ] = MAKE_SAFE_WAIT_S,
    as_json: Json = False,
) -> None:
    """Put the vacuum on without a daemon.

    For the time after one that was killed; while one runs, use abort.
    """
    from impactd.console import make_safe as console

    console.run(config, wait, as_json=as_json)


def demo(
    seed: Annotated[
        int | None,
        typer.Option("--seed", min=0, help=("Seed of everything drawn; random without it.")),
    ] = None,
    effect: Annotated[
        str,
        typer.Option(
            "--effect",
            help="Hidden effect of the rig: an effect's id, random, or none.",
            autocompletion=completions.effects,
        ),
    ] = "random",
    out: Annotated[Path, typer.Option("--out", help="Where the results go.")] = Path(
        "impactd-demo"
    ),
    as_json: Annotated[
        bool, typer.Option("--json", help="Print the outcome as JSON; progress goes to stderr.")
    ] = False,
) -> None:
    """Do the whole job once on a simulated rig.

    Drops, moduli, and what the model lacks; then the truth.
    """
    from impactd.demo import run_demo

    raise typer.Exit(run_demo(seed=seed, effect=effect, out=out, as_json=as_json))


def bench(
    only: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[NAME]...",
            help="solver, stream, store, fit_speed, scale: all without a name; "
            "refit, study, readers, coverage, blind: minutes.",
        ),
    ] = None,
    json_out: JsonOut = None,
    blind: Annotated[
        bool, typer.Option("--blind", help="Blind trials of the diagnosis; the same as NAME blind.")
    ] = False,
) -> None:
    """Measure speed, each figure as a ratio within the same run."""
    from impactd.bench import run

    names = [*(only or []), *(["blind"] if blind and "blind" not in (only or []) else [])]
    raise typer.Exit(run(json_out, names or None))


def doctor(config: Config = None, data: Data = None, as_json: Json = False) -> None:
    """Check the installation, and say how to repair it.

    Packages, configuration, permissions, disk, tokens and devices.
    """
    from impactd.console import doctor as console

    console.run(config, data, as_json=as_json)
