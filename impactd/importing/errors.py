"""Errors of somebody's recording, each one sentence with a remedy."""

from __future__ import annotations


class RecordingError(Exception):
    """A recording cannot become a campaign.

    Parameters
    ----------
    where : str
        The file, and the place in it where there is one.
    what : str
        What is wrong, with values and units; continues a sentence that begins with the file.
    remedy : str
        What to do about it, mostly an option of the command.
    """

    def __init__(self, where: str, what: str, remedy: str = "") -> None:
        self.where = where
        self.what = what
        self.remedy = remedy
        super().__init__(" ".join(part for part in (where, what, remedy) if part))
