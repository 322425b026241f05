"""What is wrong with a certificate, or missing for one."""

from __future__ import annotations


class CertificateError(Exception):
    """A certificate cannot be written or used.

    Parameters
    ----------
    what : str
        What happened, with values and units.
    remedy : str
        What to do about it.
    """

    def __init__(self, what: str, remedy: str) -> None:
        self.what = what
        self.remedy = remedy
        super().__init__(f"{what} {remedy}")
