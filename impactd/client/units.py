"""Lengths: ``45 * mm`` is 0.045 m, exactly the number of a settings file."""

from __future__ import annotations


class _PartOfMetre:
    """A unit; a product with it divides, because 9 * 1e-3 is not 0.009."""

    def __init__(self, per_metre: int) -> None:
        self._per_metre = per_metre

    def __rmul__(self, count: float) -> float:
        return count / self._per_metre


mm = _PartOfMetre(1000)
cm = _PartOfMetre(100)
m = _PartOfMetre(1)
