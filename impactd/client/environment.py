"""The address of the daemon and the token, from the environment."""

from __future__ import annotations

import getpass
import os
from pathlib import Path

from impactd.client.errors import RigError

DEFAULT_URL = "http://127.0.0.1:8642"


def address(url: str | None) -> str:
    """Return where the daemon is: as given, by the environment, or where it listens by default."""
    return url or os.environ.get("IMPACTD_URL") or DEFAULT_URL


def token_from_environment() -> str | None:
    """Return the token: IMPACTD_TOKEN, or the file that IMPACTD_TOKEN_FILE names.

    Returns
    -------
    str or None
        ``None`` when neither is set.

    Raises
    ------
    RigError
        If the file cannot be read.
    """
    token = os.environ.get("IMPACTD_TOKEN")
    file = os.environ.get("IMPACTD_TOKEN_FILE")
    if not token and file:
        try:
            token = Path(file).read_text(encoding="utf-8")
        except OSError as error:
            raise RigError(f"the token file {file} cannot be read: {error.strerror}.") from error
    return token.strip() if token else None


def login_name() -> str:
    """Return who is at the keyboard, ``unknown`` where the system cannot say."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "unknown"
