"""Idempotency keys belong to one token and one kind of job.

Stored as ``token 3 KEY`` for drops and calibrations and ``token 3 fit KEY`` for jobs, so that no
key of one client meets another's, or one that the daemon made for itself.
"""

from __future__ import annotations

import re

from impactd.api.security import Caller
from impactd.storage.request_key import RequestKey

FIT = "fit"
DIAGNOSIS = "diagnosis"
CALIBRATION = "calibration"
_NAMESPACE = re.compile(rf"token \d+ (?:(?:{FIT}|{DIAGNOSIS}|{CALIBRATION}) )?")


def drop_key(caller: Caller, key: str) -> str:
    """Return a client's key for a drop as it is stored."""
    return RequestKey(f"token {caller.token_id}", key).text


def job_key(caller: Caller, kind: str, key: str | None) -> str | None:
    """Return a client's key for a job, or a calibration's slot, as it is stored.

    ``kind`` is `FIT`, `DIAGNOSIS` or `CALIBRATION`. ``None`` where the client sent no key.
    """
    return None if key is None else RequestKey(f"token {caller.token_id} {kind}", key).text


def own_part(stored: str) -> str:
    """Return a stored key as its client sent it; a key without a client stays unchanged."""
    return _NAMESPACE.sub("", stored, count=1)
