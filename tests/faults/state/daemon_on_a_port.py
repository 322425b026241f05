"""`impactd` on a simulated rig whose relay board stands outside and outlives it.

Run as a script; the board's port is in ``RELAY_PORT``.
"""

from __future__ import annotations

import os
from typing import Any

from impactd.rig import simulated as simulated_rig


class _BoardOutside:
    """Takes the place of the board that the simulated rig would make for itself."""

    def __init__(self, _world: Any, kind: str) -> None:
        self.kind = kind
        self.port = os.environ["RELAY_PORT"]

    def close(self) -> None:
        """Leave the board as it is: somebody else's hand holds its cable."""


if __name__ == "__main__":
    simulated_rig.RelayTerminal = _BoardOutside  # type: ignore[misc, assignment]
    from impactd.cli import main

    main()
