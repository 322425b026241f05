"""Webhooks: every event as a signed POST, repeated until it is accepted.

The headers and the signature are those of Standard Webhooks (standardwebhooks.com): HMAC-SHA-256
over id, time and body, so that any of its libraries checks them.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import time
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

import httpx2

from impactd.bridges.message import event_json
from impactd.bridges.other_end import OtherEnd, Say
from impactd.bridges.place import Place
from impactd.client.async_rig import AsyncRig
from impactd.client.errors import RigError

FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 300.0
"""Doubled from one to the other: a receiver that is away for a night is asked every 5 minutes."""
TIMEOUT_S = 10.0
"""For an answer. A choice: whoever needs longer takes an event first and works afterwards, and what
was not answered comes again."""
LEAST_SECRET_BYTES = 24
"""What Standard Webhooks asks for."""
_PREFIX = "whsec_"


def read_secret(text: str) -> bytes:
    """Return the key of a secret ``whsec_<base64>``.

    Returns
    -------
    bytes
        At least 24.

    Raises
    ------
    RigError
        If it is something else, or too short to be a secret.
    """
    try:
        key = base64.b64decode(text.strip().removeprefix(_PREFIX), validate=True)
    except ValueError as error:
        raise RigError("the secret is not base64; it looks like whsec_MfKQ9r8G...") from error
    if len(key) < LEAST_SECRET_BYTES:
        raise RigError(
            f"the secret has {len(key)} bytes; it needs {LEAST_SECRET_BYTES} or more: "
            "openssl rand -base64 32"
        )
    return key


def signed_headers(key: bytes, message_id: str, body: bytes, at_s: int) -> dict[str, str]:
    """Return the headers that prove where a body comes from."""
    signed = b"%s.%d.%s" % (message_id.encode(), at_s, body)
    signature = base64.b64encode(hmac.digest(key, signed, hashlib.sha256)).decode()
    return {
        "Content-Type": "application/json",
        "webhook-id": message_id,
        "webhook-timestamp": str(at_s),
        "webhook-signature": f"v1,{signature}",
    }


@dataclass(frozen=True)
class Receiver:
    """Who is told.

    Attributes
    ----------
    kinds : tuple of str
        What it wants to hear, as beginnings: ``drop.`` or ``drop.stored``. None is all.
    """

    url: str
    key: bytes
    kinds: tuple[str, ...] = ()


async def carry(
    rig: AsyncRig,
    receiver: Receiver,
    place: Place,
    say: Say,
    *,
    sleep: Callable[[float], Awaitable[None]] = asyncio.sleep,
) -> None:
    """Carry events to a receiver until cancelled, in their order.

    Parameters
    ----------
    place : Place
        Behind which event it begins; it moves on when the receiver has answered with 2xx.
    say : callable
        Takes a sentence when the receiver does not take an event, and when it takes one again.
    sleep : callable, optional
        Waits between attempts.

    Notes
    -----
    An event that is refused, or that nobody takes, is sent again after 1, 2, 4, ... 300 seconds,
    and those behind it wait: the daemon keeps them. ``webhook-id`` stays the same.
    """
    there = OtherEnd(f"The receiver {receiver.url}", say)
    async with httpx2.AsyncClient(timeout=TIMEOUT_S, trust_env=False) as http:
        async for event in rig.events(place.last):
            if not receiver.kinds or event.kind.startswith(receiver.kinds):
                body, name = event_json(event), f"event-{event.id}"
                pause_s = FIRST_PAUSE_S
                while why := await _refused(http, receiver, name, body):
                    there.is_away(why)
                    await sleep(pause_s)
                    pause_s = min(2 * pause_s, LONGEST_PAUSE_S)
                there.is_there()
            place.arrived(event.id)


async def _refused(
    http: httpx2.AsyncClient, receiver: Receiver, name: str, body: bytes
) -> str | httpx2.TransportError | None:
    """Send an event; return why it was not taken, None if it was."""
    headers = signed_headers(receiver.key, name, body, int(time.time()))
    try:
        answer = await http.post(receiver.url, content=body, headers=headers)
    except httpx2.TransportError as error:
        return error
    return None if answer.is_success else f"it answered {name} with {answer.status_code}"
