"""A sign-in code on the terminal: the code, the page, and a picture for a camera."""

from __future__ import annotations

import io
import ipaddress
import os
import sys
from urllib.parse import urlsplit

from impactd.client.environment import address
from impactd.console.client import connect
from impactd.console.tables import paint, print_json

# White on black, whatever the terminal's colours are: some cameras read no inverted picture.
_WHITE_ON_BLACK, _USUAL = "\x1b[97;40m", "\x1b[0m"


def run(*, page: str | None, url: str | None, as_json: bool) -> None:
    """Ask the daemon for a code and print it."""
    with connect(url) as client:
        answer = client.send("POST", "/v1/sign-in-codes")
    place = (page or address(url)).rstrip("/")
    # Behind the #, which no browser sends: the code is in no log of a server or a proxy.
    link = f"{place}/#/sign-in/{answer['code']}"
    if as_json:
        print_json({**answer, "page": place, "link": link})
        return
    print(f"Code: {paint(answer['code'])}")
    print(f"Page: {place}")
    only_here = _is_loopback(place)
    if not only_here and _shows_pictures():
        print(f"\n{_picture(link)}\n")
    print(
        f"Type the code on the page within {answer['life_s'] / 60:.0f} minutes. It works once, "
        f"with the rights of the token {answer['name']} ({answer['scope']})."
    )
    if only_here:
        print(
            "This address works on this computer only. For a tablet or a phone give the page's "
            "address there: --page https://..., or IMPACTD_PAGE_URL."
        )


def _picture(link: str) -> str:
    """Return a link as a QR code of half blocks."""
    import segno  # noqa: PLC0415 - a pipe and --json need no picture

    drawn = io.StringIO()
    segno.make_qr(link).terminal(drawn, compact=True)
    return "\n".join(f"{_WHITE_ON_BLACK}{line}{_USUAL}" for line in drawn.getvalue().splitlines())


def _shows_pictures() -> bool:
    """Return whether standard output is a terminal that has colours and the blocks."""
    if not sys.stdout.isatty() or os.environ.get("TERM") == "dumb":
        return False
    try:
        "▀▄█".encode(sys.stdout.encoding)
    except UnicodeEncodeError:
        return False
    return True


def _is_loopback(place: str) -> bool:
    """Return whether an address leads to the device itself, whatever device opens it."""
    host = urlsplit(place).hostname or ""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
