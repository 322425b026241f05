"""Tell systemd how the daemon is: the notification protocol of ``sd_notify(3)``.

A notification is one datagram of ``NAME=value`` lines to the socket that ``$NOTIFY_SOCKET`` names.
Outside systemd there is no such socket and everything here does nothing.
"""

from __future__ import annotations

import os
import socket


def notify(**fields: str) -> bool:
    """Send one notification; return whether it was sent.

    It is not outside systemd, nor where the socket refuses or its queue is full: a daemon that
    runs well must neither end nor wait because nobody listens. It must not delay the valve when
    the daemon stops.

    Parameters
    ----------
    **fields : str
        The protocol's names in small letters: ``ready="1"``, ``stopping="1"``, ``watchdog="1"``,
        ``status="READY: ..."``. A line break in a value becomes a space.

    Notes
    -----
    Source: ``sd_notify(3)``, section "Notes", which invites its own implementations. A socket
    whose name starts with ``@`` lives in Linux's abstract namespace.
    """
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return False
    if address.startswith("@"):
        address = "\0" + address[1:]
    message = "\n".join(
        f"{name.upper()}={' '.join(value.splitlines())}" for name, value in fields.items()
    )
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as sender:
            sender.setblocking(False)
            sender.connect(address)
            sender.sendall(message.encode())
    except OSError:
        return False
    return True


def watchdog_interval_s() -> float | None:
    """Return half the time in which systemd wants to hear ``watchdog="1"``, as it recommends. [s]

    ``None`` where no watchdog waits for this process. Source: ``sd_watchdog_enabled(3)``.
    ``$WATCHDOG_PID`` names the process that is meant, because children inherit the environment.
    """
    meant = os.environ.get("WATCHDOG_PID", "")
    if meant and meant != str(os.getpid()):
        return None
    limit_us = os.environ.get("WATCHDOG_USEC", "")
    if not limit_us.isdecimal() or int(limit_us) == 0:
        return None
    return int(limit_us) / 2e6
