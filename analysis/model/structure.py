r"""What the sphere lands on: masses, springs and dashpots, assembled like a finite-element model.

The base model is one mass (the crystal M) on one spring and dashpot (k, mu) to a rigid frame.
Effects of the mounting and of the stand add masses and links. The assembled system is

.. math:: \dot s = A s + b F, \quad s = (q_1, \dot q_1, q_2, \dot q_2, \dots)

with the contact force F on the mass called ``top``; what the sphere feels is the top's motion, what
the cell reads is the compression between the crystal and its base.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FRAME = "frame"
"""The laboratory; never moves."""


@dataclass
class Structure:
    """Masses by name, links between them.

    Attributes
    ----------
    masses : dict
        Mass by name. [kg]
    links : list of tuple
        (one, other, stiffness [N/m], damping [N s/m]); ``FRAME`` may be an end.
    top : str
        The mass that the sphere touches.
    crystal, base : str
        The cell reads the crystal's displacement less the base's.
    """

    masses: dict[str, float] = field(default_factory=dict)
    links: list[tuple[str, str, float, float]] = field(default_factory=list)
    top: str = "crystal"
    crystal: str = "crystal"
    base: str = FRAME

    @classmethod
    def kelvin_voigt(cls, mass_kg: float, stiffness: float, damping: float) -> Structure:
        """Return the base model's crystal on a rigid frame."""
        return cls({"crystal": mass_kg}, [("crystal", FRAME, stiffness, damping)])

    def add(self, name: str, mass_kg: float) -> None:
        """Add a mass. [kg]"""
        self.masses[name] = mass_kg

    def link(self, one: str, other: str, stiffness: float, damping: float) -> None:
        """Join two masses by a spring [N/m] and a dashpot [N s/m]."""
        self.links.append((one, other, stiffness, damping))

    def move_base(self, name: str) -> None:
        """Put the crystal's foot on a mass instead of the frame; existing links move with it."""
        self.links = [
            (a, name if b == self.base and a == self.crystal else b, k, c)
            for a, b, k, c in self.links
        ]
        self.base = name

    def assemble(
        self,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], int]:
        """Return the system as matrices.

        Returns
        -------
        system : ndarray, shape (2n, 2n)
            A. [1/s, 1, ...]
        load : ndarray, shape (2n,)
            b: effect of a unit force on the top. [1/kg]
        reading : ndarray, shape (2n,)
            Row that gives the crystal's compression. [1]
        top : int
            Index of the top's displacement in s; its velocity follows.
        """
        order = list(self.masses)
        size = 2 * len(order)
        at = {name: 2 * i for i, name in enumerate(order)}
        system = np.zeros((size, size))
        for i in range(0, size, 2):
            system[i, i + 1] = 1.0
        for one, other, k, c in self.links:
            for a, b in ((one, other), (other, one)):
                if a == FRAME:
                    continue
                row, mass = at[a] + 1, self.masses[a]
                system[row, at[a]] -= k / mass
                system[row, at[a] + 1] -= c / mass
                if b != FRAME:
                    system[row, at[b]] += k / mass
                    system[row, at[b] + 1] += c / mass
        load = np.zeros(size)
        load[at[self.top] + 1] = 1.0 / self.masses[self.top]
        reading = np.zeros(size)
        reading[at[self.crystal]] = 1.0
        if self.base != FRAME:
            reading[at[self.base]] -= 1.0
        return system, load, reading, at[self.top]
