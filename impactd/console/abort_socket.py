"""Aborting through the daemon's Unix socket, from the command line's side."""

from __future__ import annotations

import ipaddress
import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from impactd.abort_door import SYSTEM_FOLDER, is_private, private_folder, socket_name

# The answer takes some ten milliseconds; whoever waits longer should try the other way.
_PATIENCE_S = 2.0
_LONGEST_ANSWER = 65536


def abort_through_socket(url: str, name: str) -> dict[str, Any] | None:
    """Abort through the socket of the daemon at an address on this machine.

    Parameters
    ----------
    url : str
        The daemon's.

    Returns
    -------
    dict or None
        As `POST /v1/abort` answers; ``None`` where no socket answers, or the address is elsewhere.
    """
    port = _local_port(url)
    if port is None:
        return None
    for path in _paths(port):
        answer = _ask(path, name)
        if answer is not None:
            return answer
    return None


def _local_port(url: str) -> int | None:
    try:
        parts = urlsplit(url)
        host, port = parts.hostname or "", parts.port or 80
        local = host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return None
    return port if local and parts.scheme == "http" else None


def _paths(port: int) -> Iterator[Path]:
    yield SYSTEM_FOLDER / socket_name(port)
    session = os.environ.get("XDG_RUNTIME_DIR")
    if session:
        yield Path(session) / "impactd" / socket_name(port)
    if is_private(private_folder()):  # or somebody else could answer there
        yield private_folder() / socket_name(port)


def _ask(path: Path, name: str) -> dict[str, Any] | None:
    line = f"abort {' '.join(name.split())[:64]}\n".encode()
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
            connection.settimeout(_PATIENCE_S)
            connection.connect(str(path))
            connection.sendall(line)
            with connection.makefile("rb") as reader:
                answer = json.loads(reader.readline(_LONGEST_ANSWER))
    except (OSError, ValueError):
        return None
    return answer if isinstance(answer, dict) and "sentence" in answer else None
