"""Options that several commands share."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

if TYPE_CHECKING:
    from impactd.settings.settings import Settings
    from impactd.storage.archive import Archive


def written(*endings: str) -> Callable[[Path | None], Path | None]:
    """Return a check of where something is to be written, made before anything is computed."""

    def check(path: Path | None) -> Path | None:
        """Return the path; wrong usage where nothing can be written there."""
        if path is None or str(path) == "-":
            return path
        if endings and path.suffix.lower() not in endings:
            raise typer.BadParameter(f"{path} must end in {' or '.join(endings)}.")
        if path.is_dir():
            raise typer.BadParameter(f"{path} is a folder; name a file in it.")
        if not path.parent.is_dir():
            raise typer.BadParameter(
                f"{path} cannot be written: there is no folder {path.parent}. Make it, or "
                "name another."
            )
        return path

    return check


Url = Annotated[
    str | None,
    typer.Option(
        "--url",
        envvar="IMPACTD_URL",
        help="Address of the daemon; the token comes from IMPACTD_TOKEN.",
        show_default="http://127.0.0.1:8642",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="Print the answer as JSON.")]
JsonOut = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="[OUT]",
        help="Print the answer as JSON, or write it to a file.",
        callback=written(),
    ),
]


_PLAIN_WORDS = {
    "int_parsing": "it must be a whole number",
    "float_parsing": "it must be a number",
    "finite_number": "it must be a finite number",
}


class PlainGroup(TyperGroup):
    """Commands whose wrong arguments are told in plain words, not in those of a library."""

    def invoke(self, ctx: Any) -> Any:
        """Run a command."""
        try:
            return super().invoke(ctx)
        except typer.BadParameter as error:
            if isinstance(error.__cause__, ValueError) and hasattr(error.__cause__, "errors"):
                error.message = _plain(error.__cause__.errors()[0])
            raise


def _plain(wrong: dict[str, Any]) -> str:
    """Return what pydantic found wrong, in plain words."""
    said = str(wrong["msg"]).removeprefix("Value error, ")
    if wrong["type"] == "value_error":
        return said
    said = _PLAIN_WORDS.get(wrong["type"], said.replace("Input should", "it must"))
    return f"{wrong['input']!r} cannot be taken; {said}."


class JsonCommand(TyperCommand):
    """A command with `JsonOut`: its ``--json`` without a file prints, as that of all others."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take a last ``--json``, or one before another option, for ``--json -``."""
        for at in reversed(range(len(args))):
            after = args[at + 1] if at + 1 < len(args) else "--"
            if args[at] == "--json" and after.startswith("-") and after != "-":
                args.insert(at + 1, "-")
        return super().parse_args(ctx, args)


Csv = Annotated[
    Path | None,
    typer.Option(
        "--csv",
        metavar="OUT.csv",
        help="Also write the numbers for a spreadsheet.",
        callback=written(),
    ),
]
Config = Annotated[
    Path | None,
    typer.Option(
        "--config", "-c", envvar="IMPACTD_CONFIG", help="The rig's settings, a TOML file."
    ),
]
Data = Annotated[
    Path | None, typer.Option("--data", help="Folder of the archive, instead of the settings'.")
]


class Rule(StrEnum):
    """How a modulus is compared with its limits."""

    BOTH = "both"
    ACCEPTANCE = "acceptance"
    REJECTION = "rejection"
    SIMPLE = "simple"


class Modulus(StrEnum):
    """Which of a material's moduli a limit is for."""

    YOUNG = "young"
    PLANE_STRAIN = "plane-strain"


Lower = Annotated[
    float | None,
    typer.Option("--lower", metavar="PA", help="The modulus must be at least this. [Pa]"),
]
Upper = Annotated[
    float | None,
    typer.Option("--upper", metavar="PA", help="The modulus must be at most this. [Pa]"),
]
DecisionRule = Annotated[
    Rule,
    typer.Option(
        "--rule",
        help=(
            "both: pass and fail need the guard band, otherwise undecided. acceptance: a "
            "pass needs it. rejection: a fail needs it. simple: none."
        ),
    ),
]
Guard = Annotated[
    float,
    typer.Option(
        "--guard", metavar="R", min=0, max=10, help="Guard band over the expanded uncertainty."
    ),
]
Of = Annotated[
    Modulus, typer.Option("--of", help="What limits and signature are for: E, or E/(1-nu^2).")
]
Report = Annotated[
    Path | None,
    typer.Option(
        "--report",
        metavar="OUT",
        help="Write a report here; ends in .html or .pdf.",
        callback=written(".html", ".pdf"),
    ),
]
SignWith = Annotated[
    Path | None,
    typer.Option(
        "--sign-with",
        metavar="KEY",
        help="Sign the report, a PDF of one modulus: PKCS#12 (.p12, .pfx), or a key as PEM. The "
        "passphrase is asked for, or read from IMPACTD_SIGN_PASSPHRASE.",
    ),
]
SignCertificate = Annotated[
    Path | None,
    typer.Option(
        "--sign-certificate",
        metavar="PEM",
        help="Certificate, and those of its issuers, if KEY has none.",
    ),
]
SignPassphrase = Annotated[
    Path | None,
    typer.Option("--sign-passphrase-file", metavar="FILE", help="Holds only KEY's passphrase."),
]
SignReason = Annotated[
    str, typer.Option("--sign-reason", metavar="WORDS", help="Stands in the signature.")
]
SIGN_REASON = "I have checked this result"


def settings_of(config: Path | None, data: Path | None) -> Settings:
    """Return the checked settings of a command.

    Parameters
    ----------
    config, data : Path or None
        As given on the command line.

    Returns
    -------
    Settings
        Of the file, with the data directory replaced.
    """
    from impactd.settings.settings import load_settings

    return load_settings(config, data=data)


def open_archive(config: Path | None, data: Path | None, *, existing: bool = False) -> Archive:
    """Return the archive of a command; beside a running daemon that is safe.

    Parameters
    ----------
    config, data : Path or None
        As given on the command line.
    existing : bool, optional
        Refuse a folder without an archive instead of beginning one there.

    Returns
    -------
    Archive
        Open; use it in a ``with`` block.

    Raises
    ------
    Failure
        If there is none, and it has to exist.
    """
    from impactd.console.failure import Failure
    from impactd.storage.archive import Archive, is_archive

    settings = settings_of(config, data)
    if existing and not is_archive(settings.storage.directory):
        raise Failure(
            f"{settings.storage.directory} holds no archive. Give --data the folder that the "
            "daemon runs with."
        )
    return Archive.open(settings.storage.directory, reserve_bytes=settings.storage.reserve_bytes)
