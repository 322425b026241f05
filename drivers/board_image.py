"""An image that the user supplies for a board: firmware, or an FPGA's bit stream."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

from drivers.errors import FirmwareError


@dataclass(frozen=True)
class Image:
    """A file the user supplied."""

    name: str
    content: bytes

    @property
    def sha256(self) -> str:
        """Hash of the file, recorded with every shot."""
        return hashlib.sha256(self.content).hexdigest()


def read_image(path: Path | None, setting: str) -> Image:
    """Return the image a setting points to; FirmwareError if it is not set, unreadable or empty.

    ``setting`` is the setting's name, for the message.
    """
    if path is None:
        raise FirmwareError(
            f"The digitizer has no firmware yet and {setting} is not set.",
            why="The images are the maker's property and are not shipped with this program.",
            remedy=f"Take them from the maker's installation and set {setting}.",
        )
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FirmwareError(
            f"The image {path} cannot be read ({error.strerror}).",
            remedy=f"Correct {setting} in the digitizer section of the settings.",
        ) from error
    if not content:
        raise FirmwareError(f"The image {path} is empty.", remedy=f"Correct {setting}.")
    return Image(str(path), content)
