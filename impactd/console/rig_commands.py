"""Commands that ask the daemon: status, drop, abort, calibrate, shots, moduli."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

import itertools
import math
import re
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand

from impactd.console import completions
from impactd.console.options import (
    SIGN_REASON,
    Csv,
    DecisionRule,
    Guard,
    Json,
    Lower,
    Modulus,
    Of,
    Report,
    Rule,
    SignCertificate,
    SignPassphrase,
    SignReason,
    SignWith,
    Upper,
    Url,
)

_TALL_M = 2.0
"""Nobody hangs a sphere so high above a load cell; millimetres were meant."""
_NO_TOKEN, _LOW_SCOPE = 401, 403

_Since = Annotated[str | None, typer.Option("--since", help="Begin of the period, ISO 8601.")]
_Until = Annotated[
    str | None, typer.Option("--until", help=("End of the period, exclusive, ISO 8601."))
]


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(cls=_DropCommand)(drop)
    for command in (status, abort, calibrate, shots, moduli):
        app.command()(command)


def status(url: Url = None, as_json: Json = False) -> None:
    """Say READY or NOT READY, why, and what to do; then every open alarm."""
    from impactd.client.errors import ProblemError
    from impactd.console.client import connect
    from impactd.console.tables import paint, print_json

    with connect(url) as client:
        answer = client.get("/v1/status")
        try:
            alarms = client.get("/v1/alarms")["open"]
        except ProblemError as error:
            if error.status not in (_NO_TOKEN, _LOW_SCOPE):
                raise
            alarms = None  # the status is for everybody on this computer, alarms need a token
    if as_json:
        print_json({**answer, "alarms": alarms})
        return
    light = "READY" if answer["ready"] else "NOT READY"
    colour = "green" if answer["ready"] else "red"
    print(answer["sentence"].replace(light, paint(light, colour), 1))
    if answer["drop"]:
        print(f"Drop {answer['drop']} of {answer['owner']}: {answer['state']}.")
    for alarm in sorted(alarms or [], key=lambda one: str(one["severity"])):  # major before minor
        _print_alarm(alarm)
    if alarms:
        print("\nAcknowledge alarms on the page, at the top of each view.")
    if alarms is None:
        print("Open alarms are shown to a token: set IMPACTD_TOKEN or IMPACTD_TOKEN_FILE.")


def _print_alarm(alarm: dict[str, Any]) -> None:
    from impactd.console.tables import paint, wrapped

    colour = "red" if alarm["severity"] == "major" else "yellow"
    times = f", {alarm['times']} times" if alarm["times"] > 1 else ""
    head = f"Alarm {alarm['id']} ({alarm['severity']}{times}, since {alarm['first_utc'][:16]} UTC)"
    print(f"\n{paint(head, colour)}")
    print(wrapped(alarm["sentence"]))
    for number, step in enumerate(alarm["guidance"], 1):
        print(wrapped(step, f"  {number}. "))


class _DropCommand(TyperCommand):
    """Answers a height below zero, or with a unit, before it is taken for an option or a word."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse as always, but refuse such a height with what to type instead."""
        for before, word in itertools.pairwise(["", *args]):
            below = re.match(r"-\.?\d", word) and not before.startswith("-")
            if below or re.fullmatch(r"[\d.]+ *[cm]?m", word):
                raise typer.BadParameter(
                    f"the drop height {word!r} must be a number above 0, in metres and without a "
                    "unit, e.g. 0.045"
                )
        return super().parse_args(ctx, args)


def drop(  # noqa: PLR0917 - the framework fills them by name
    sphere: Annotated[
        str | None,
        typer.Argument(help="Name in the materials file.", autocompletion=completions.spheres),
    ] = None,
    surface: Annotated[
        str | None,
        typer.Argument(help="Name in the materials file.", autocompletion=completions.surfaces),
    ] = None,
    drop_height_m: Annotated[
        float | None, typer.Argument(help="Lowest point of the sphere above the surface. [m]")
    ] = None,
    proposed_by: Annotated[
        int | None,
        typer.Option(
            "--proposed-by",
            metavar="DIAGNOSIS",
            min=1,
            help="Make the drop that a diagnosis proposes, instead of naming one.",
        ),
    ] = None,
    operator: Annotated[
        str | None, typer.Option("--operator", "-o", help="Who hangs the sphere; your login name.")
    ] = None,
    temperature: Annotated[
        float | None,
        typer.Option("--temperature", metavar="C", help="Of spheres and coupons. [degC]"),
    ] = None,
    temperature_u: Annotated[
        float | None,
        typer.Option("--temperature-u", metavar="K", help="Its standard uncertainty. [K]"),
    ] = None,
    humidity: Annotated[
        float | None,
        typer.Option("--humidity", metavar="SHARE", help="Relative, of the air; 0.45 is 45 %."),
    ] = None,
    humidity_u: Annotated[
        float | None,
        typer.Option("--humidity-u", metavar="SHARE", help="Its standard uncertainty."),
    ] = None,
    wait: Annotated[bool, typer.Option(help="Wait for the modulus.")] = True,
    key: Annotated[
        str | None, typer.Option("--key", help="Idempotency key; a repetition drops nothing.")
    ] = None,
    url: Url = None,
    as_json: Json = False,
) -> None:
    """Drop a sphere, and wait for its modulus."""
    from impactd.client.environment import login_name
    from impactd.console import drops

    _refuse_no_numbers(
        {
            "the drop height": drop_height_m,
            "--temperature": temperature,
            "--temperature-u": temperature_u,
            "--humidity": humidity,
            "--humidity-u": humidity_u,
        }
    )
    named = {"sphere": sphere, "surface": surface, "drop_height_m": drop_height_m}
    if proposed_by is None and None in named.values():
        raise typer.BadParameter("name sphere, surface and drop height, or give --proposed-by")
    if proposed_by is not None and any(value is not None for value in named.values()):
        raise typer.BadParameter("a drop that a diagnosis proposes has its own sphere and height")
    if drop_height_m is not None and drop_height_m >= _TALL_M:
        raise typer.BadParameter(
            f"the drop height is in metres: {drop_height_m:g} mm would be {drop_height_m / 1e3:g}"
        )
    environment = drops.environment_members(
        {
            "temperature_C": ("--temperature", temperature, temperature_u),
            "relative_humidity": ("--humidity", humidity, humidity_u),
        }
    )
    who = {"operator": operator or login_name(), **environment}
    drops.run(
        who if proposed_by is not None else {**named, **who},
        proposed_by=proposed_by,
        key=key,
        wait=wait,
        url=url,
        as_json=as_json,
    )


def _refuse_no_numbers(given: dict[str, float | None]) -> None:
    """Refuse `nan` and `inf`, which are numbers to Python and none to JSON or to a rig."""
    for name, value in given.items():
        if value is not None and not math.isfinite(value):
            raise typer.BadParameter(f"{name} is {value:g}; give a number.")


def abort(url: Url = None, as_json: Json = False) -> None:
    """Abort whatever the rig does, at once.

    The vacuum comes back on. On the daemon's own machine this goes through its abort socket, which
    answers whatever the web server and the disk do; from elsewhere, or without one, over HTTP.
    """
    from impactd.client.environment import address, login_name
    from impactd.console.abort_socket import abort_through_socket
    from impactd.console.client import connect
    from impactd.console.tables import print_json

    answer, way = abort_through_socket(address(url), login_name()), "the abort socket"
    if answer is None:
        with connect(url) as client:
            answer, way = client.send("POST", "/v1/abort"), "HTTP"
    if as_json:
        print_json({**answer, "way": way})
    else:
        print(answer["sentence"])
        print(f"Through {way}; {answer['took_ms']:.0f} ms from receipt to safe.")


def calibrate(  # noqa: PLR0917 - the framework fills them by name
    wait: Annotated[bool, typer.Option("--wait", help="Wait until it is done.")] = False,
    slot: Annotated[
        str | None,
        typer.Option(
            "--slot", help="The timer's slot: the same slot never runs twice. Implies unattended."
        ),
    ] = None,
    attended: Annotated[
        bool | None,
        typer.Option("--attended/--unattended", help="Whether somebody stands by the rig."),
    ] = None,
    history: Annotated[
        bool, typer.Option("--history", help="Show all calibrations and the cell's drift instead.")
    ] = False,
    chart: Annotated[
        Path | None,
        typer.Option("--chart", metavar="OUT.png", help="With --history: draw the drift chart."),
    ] = None,
    static: Annotated[
        Path | None,
        typer.Option(
            "--static",
            metavar="FILE.csv",
            help="Calibrate with weights instead: columns mass_kg, volts and, if known, u_volts.",
        ),
    ] = None,
    hold_time_s: Annotated[
        float | None,
        typer.Option("--hold-time", help="With --static: seconds from weight to reading.", min=0),
    ] = None,
    discharge_time_s: Annotated[
        float | None,
        typer.Option("--discharge-time", help="With --static: time constant in seconds."),
    ] = None,
    url: Url = None,
    as_json: Json = False,
) -> None:
    """Calibrate the load cell.

    With the reference spheres of the settings' plan, or with weights.
    """
    from impactd.console import calibration_chart, calibrations

    if history or chart is not None:
        calibration_chart.history(chart=chart, url=url, as_json=as_json)
        return
    if static is not None:
        if hold_time_s is None:
            raise typer.BadParameter("--static needs --hold-time: a reading decays from the start")
        calibrations.weights(
            static,
            hold_time_s=hold_time_s,
            discharge_time_constant_s=discharge_time_s,
            url=url,
            as_json=as_json,
        )
        return
    unattended = slot is not None if attended is None else not attended
    calibrations.run(slot=slot, unattended=unattended, wait=wait, url=url, as_json=as_json)


def shots(  # noqa: PLR0917 - the framework fills them by name
    number: Annotated[int | None, typer.Argument(help="Show this one; without it, list.")] = None,
    sphere: Annotated[
        str | None, typer.Option("--sphere", autocompletion=completions.spheres)
    ] = None,
    surface: Annotated[
        str | None, typer.Option("--surface", autocompletion=completions.surfaces)
    ] = None,
    since: _Since = None,
    until: _Until = None,
    limit: Annotated[int, typer.Option("--limit", min=1, help="At most so many.")] = 20,
    url: Url = None,
    as_json: Json = False,
) -> None:
    """List stored shots, newest first, or show one with its fits."""
    from impactd.console import shots as console

    if number is not None:
        console.show(number, url=url, as_json=as_json)
        return
    filters: dict[str, Any] = {
        "sphere": sphere,
        "surface": surface,
        "since": since,
        "until": until,
    }
    console.list_shots(filters, limit=limit, url=url, as_json=as_json)


def moduli(  # noqa: PLR0917 - the framework fills them by name
    specimen: Annotated[str | None, typer.Option("--specimen", help="Only this material.")] = None,
    since: _Since = None,
    until: _Until = None,
    budget: Annotated[
        bool,
        typer.Option("--budget", help="Show the uncertainty budgets instead."),
    ] = False,
    report: Report = None,
    sign_with: SignWith = None,
    sign_certificate: SignCertificate = None,
    sign_passphrase_file: SignPassphrase = None,
    sign_reason: SignReason = SIGN_REASON,
    lower: Lower = None,
    upper: Upper = None,
    rule: DecisionRule = Rule.BOTH,
    guard: Guard = 1.0,
    of: Of = Modulus.YOUNG,
    csv_out: Csv = None,
    url: Url = None,
    as_json: Json = False,
) -> None:
    """Show the fitted moduli with their uncertainties.

    With a limit also whether the specimen's modulus passes, fails or is undecided (JCGM 106).
    """
    filters = {"specimen": specimen, "since": since, "until": until}
    if not (budget or report or sign_with or lower is not None or upper is not None):
        from impactd.console.moduli import show

        show(filters, csv_out=csv_out, url=url, as_json=as_json)
        return
    if csv_out is not None:
        raise typer.BadParameter("--csv writes moduli only; use --json or --report for a budget")
    from impactd.console import budgets
    from impactd.console.decisions import Asked

    asked = Asked(lower, upper, rule, guard, of, specimen)
    if asked.limited and specimen is None:
        raise typer.BadParameter("a limit is for one material; choose it with --specimen")
    written = budgets.Report.asked_for(
        report, sign_with, sign_certificate, sign_passphrase_file, sign_reason
    )
    budgets.of_the_archive(filters, asked, written=written, url=url, as_json=as_json)
