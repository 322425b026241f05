r"""On which materials does an effect act? Its size on each, to first order, leaves few candidates.

Let :math:`c_m` be the size that material m asks for and S the information about all of them, the
rest of the model eliminated. One size for the materials of a set A, and none for the others, takes
up :math:`(1_A^T S c)^2 / (1_A^T S 1_A)` squares. Where S is diagonal the best A of all are the
first or the last so many in the order of c: two groups, one with its centre at zero, are best
parted at a threshold. So the sets that begin this order, and those that end it, which are their
complements, are the candidates; nobody counts through all :math:`2^n`. The order of what each
material alone takes up would not do: one with few shots comes late in it whatever it asks for.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.effects.acts_on import ActsOn
from analysis.fit.problem import FitShot

Array = NDArray[np.float64]
LEAST_INFORMATION = 1e-10
"""Of a matrix with ones along its diagonal; below is rounding."""


@dataclasses.dataclass(frozen=True)
class Sizes:
    """An effect's size on each material of a kind, to first order.

    Attributes
    ----------
    kind : str
        ``surface`` or ``sphere``.
    names : tuple of str
        The materials.
    values : ndarray, shape (n,)
        The size that each asks for; none where it says nothing. [the amplitude's coordinate]
    information : ndarray, shape (n, n)
        Inverse covariance of the sizes, everything else eliminated.
    """

    kind: str
    names: tuple[str, ...]
    values: Array
    information: Array

    @classmethod
    def from_score(cls, kind: str, names: Sequence[str], score: Array, information: Array) -> Sizes:
        """Return the sizes that a score asks for, the smallest where the data leave them open."""
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
        seen = values > LEAST_INFORMATION
        asked = vectors[:, seen] @ ((vectors[:, seen].T @ (score / scale)) / values[seen])
        return cls(kind, tuple(names), asked / scale, information)

    @property
    def gain(self) -> float:
        """Return the squares that a size for each material takes up."""
        return float(self.values @ self.information @ self.values)

    def common(self, names: Sequence[str]) -> tuple[float, float]:
        """Return the size that some materials have in common, and what it takes up.

        Parameters
        ----------
        names : sequence of str
            Those that the effect acts on.

        Returns
        -------
        size, gain : float
            ``gain`` in whitened squares; 0 of materials that say nothing.
        """
        inside = np.isin(self.names, names).astype(float)
        score = float(inside @ self.information @ self.values)
        known = float(inside @ self.information @ inside)
        return (score / known, score**2 / known) if known > 0.0 else (0.0, 0.0)

    def candidates(self, *, either_sign: bool = True) -> list[ActsOn]:
        """Return the sets of materials worth a fit, the most promising first.

        Parameters
        ----------
        either_sign : bool
            The effect's size may be below its neutral value as well as above.

        Returns
        -------
        list of ActsOn
            The first and the last so many in the order of the sizes, at least one and never all.
        """
        order = [self.names[j] for j in np.argsort(self.values, kind="stable")]
        sets = {tuple(sorted(order[:k])) for k in range(1, len(order))}
        sets |= {tuple(sorted(order[k:])) for k in range(1, len(order))}
        found = [
            ActsOn(self.kind, names)
            for names in sorted(sets)
            if either_sign or self.common(names)[0] > 0.0
        ]
        return sorted(found, key=lambda only: -self.promise(only))

    def promise(self, only: ActsOn) -> float:
        """Return the squares that a set's common size takes up, its choice paid for."""
        return self.common(only.names)[1] - price_of_choice(len(only.names), len(self.names))


def price_of_choice(chosen: int, present: int) -> float:
    r"""Return what it costs that some materials of a kind were chosen, and not others.

    Parameters
    ----------
    chosen, present : int
        How many of how many; all of them are no choice.

    Returns
    -------
    float
        Minus twice the logarithm of the prior, :math:`2 \ln ((n - 1) \binom{n}{k})`: before the
        data each number from 1 to n - 1 is as likely, and each set of that number. [squares]
    """
    if not 0 < chosen < present:
        return 0.0
    return 2.0 * math.log((present - 1) * math.comb(present, chosen))


def price_of_grouping(only: ActsOn | None, shots: Sequence[FitShot]) -> float:
    """Return the price of the choice in a campaign; 0 of an effect that acts on everything."""
    if only is None:
        return 0.0
    present = {getattr(item.shot, only.kind) for item in shots}
    return price_of_choice(len(present.intersection(only.names)), len(present))
