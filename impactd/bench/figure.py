"""What a benchmark returns: one measured number beside its reference and its goal."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np


@dataclass(frozen=True)
class Figure:
    """One measured figure.

    Attributes
    ----------
    name : str
        What was measured, in words a reader of the table understands.
    unit : str
        Its unit, ``"1"`` for a pure number.
    reference : float or None
        What it is compared with, in the same unit, measured in the same run where it is a time or a
        rate. ``None`` where nothing comparable exists.
    reference_name : str
        What the reference is.
    ratio : float or None
        The comparison, written so that larger is better. [1]
    goal : str
        What was asked for, e.g. ``">= 500"``; empty where nothing was.
    met : bool or None
        Whether the goal is met; ``None`` without a goal.
    """

    name: str
    value: float
    unit: str
    reference: float | None = None
    reference_name: str = ""
    ratio: float | None = None
    goal: str = ""
    met: bool | None = None

    def to_json(self) -> dict[str, object]:
        """Return the figure as JSON-ready values.

        Returns
        -------
        dict
            One key per field.
        """
        fields = asdict(self).items()
        return {name: one.item() if isinstance(one, np.generic) else one for name, one in fields}
