"""``impactd``: the command line.

Only names and options stand here and in ``impactd.console.*_commands``; what a command does is
imported when it runs, so that ``--help`` never waits for numpy or a web framework.
"""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from impactd import blas_threads
from impactd.console import (
    analysis_commands,
    archive_commands,
    backup_commands,
    bridge_commands,
    certificate_commands,
    daemon_commands,
    material_commands,
    new_command,
    paper_command,
    plot_commands,
    posterior_command,
    rig_commands,
    schema_command,
    sign_in_command,
    token_commands,
)
from impactd.console.options import PlainGroup

app = typer.Typer(
    name="impactd",
    cls=PlainGroup,
    help="Run a sphere-drop impact rig: from a drop to an elastic modulus.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # drawing boxes costs a third of the half second `--help` may take
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:
    if asked:
        from impactd import __version__

        typer.echo(f"impactd {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Run a sphere-drop impact rig: from a drop to an elastic modulus."""


daemon_commands.add_to(app)
rig_commands.add_to(app)
sign_in_command.add_to(app)
material_commands.add_to(app)
new_command.add_to(app)
analysis_commands.add_to(app)
archive_commands.add_to(app)
backup_commands.add_to(app)
plot_commands.add_to(app)
posterior_command.add_to(app)
paper_command.add_to(app)
schema_command.add_to(app)
app.add_typer(token_commands.app, name="token")
app.add_typer(bridge_commands.app, name="bridge")
app.add_typer(certificate_commands.app, name="certificate")


def main() -> None:
    """Run the command line; a failure is one sentence on stderr and exit code 1."""
    blas_threads.keep_to_one()  # nothing has imported numpy yet
    try:
        app(prog_name="impactd")
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        # The reader (`head`) has enough. Nothing may be written any more, not even at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except Exception as error:  # the person gets a sentence; developers ask for more
        if os.environ.get("IMPACTD_TRACEBACK"):
            raise
        from impactd.console.failure import sentence
        from impactd.console.progress_bar import progress

        progress("", last=True)
        print(sentence(error), file=sys.stderr)
        sys.exit(1)


if __name__ == "__main__":
    main()
