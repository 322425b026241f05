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


@dataclass(frozen=True)
class Assembled:
    """A structure of q masses as matrices; s alternates displacements and velocities."""

    accelerations: NDArray[np.float64]
    """The rows of A that give the accelerations, shape (q, 2 q). [1/s^2, 1/s, ...]"""
    load: NDArray[np.float64]
    """Acceleration by a unit force on the top. Shape (q,). [1/kg]"""
    reading: NDArray[np.float64]
    """What the cell reads of the displacements. Shape (q,). [1]"""
    top: int
    """Which mass the sphere touches."""

    @property
    def system(self) -> NDArray[np.float64]:
        """Return A whole, shape (2 q, 2 q)."""
        size = self.accelerations.shape[1]
        full = np.zeros((size, size))
        full[0::2, 1::2] = np.eye(size // 2)
        full[1::2] = self.accelerations
        return full


RIGID = Assembled(np.zeros((0, 0)), np.zeros(0), np.zeros(0), 0)
"""No masses at all: a rigid cell."""


@dataclass
class Structure:
    """Masses by name, links between them."""

    masses: dict[str, float] = field(default_factory=dict)
    """Mass by name. [kg]"""
    links: list[tuple[str, str, float, float]] = field(default_factory=list)
    """(one, other, stiffness [N/m], damping [N s/m]); ``FRAME`` may be an end."""
    top: str = "crystal"
    """The mass that the sphere touches."""
    crystal: str = "crystal"
    base: str = FRAME
    """The cell reads the displacement of ``crystal`` less that of ``base``."""
    coupon_kg: float = 0.0
    """Part of the crystal's mass that is a coupon lying on it; 0 in the paper's models. [kg]"""
    rocking: float = 0.0
    """How far the crystal's tilt moves the place that is hit, over its compression; the cell reads
    the compression alone. [1]"""

    @classmethod
    def kelvin_voigt(
        cls, mass_kg: float, stiffness: float, damping: float, coupon_kg: float = 0.0
    ) -> Structure:
        """Return the base model's crystal, with what lies on it, on a rigid frame."""
        link = ("crystal", FRAME, stiffness, damping)
        return cls({"crystal": mass_kg + coupon_kg}, [link], coupon_kg=coupon_kg)

    @property
    def bare_crystal_kg(self) -> float:
        """Return the crystal's mass without a coupon that lies on it. [kg]"""
        return self.masses[self.crystal] - self.coupon_kg

    def free_coupon(self) -> None:
        """Take the coupon's mass off the crystal; an effect gives it a place of its own."""
        self.masses["crystal"] -= self.coupon_kg
        self.coupon_kg = 0.0

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

    def assemble(self) -> Assembled:
        """Return the system as matrices.

        A rocking crystal's displacement is that of the place hit, ``1 + rocking`` times its
        compression: both obey one equation where tilt and compression have the same frequency and
        damping. So what pushes the crystal moves it more, and what it hands on or shows is less.
        """
        more = 1.0 + self.rocking
        at = {name: i for i, name in enumerate(self.masses)}
        count = len(at)
        rows = [[0.0] * (2 * count) for _ in at]
        for one, other, k, c in self.links:
            for a, b in ((one, other), (other, one)):
                if a == FRAME:
                    continue
                row, mass = rows[at[a]], self.masses[a]
                seat = {one, other} == {self.crystal, self.base}
                if a == self.crystal and not seat:
                    mass /= more
                elif a == self.base and seat:
                    mass *= more
                row[2 * at[a]] -= k / mass
                row[2 * at[a] + 1] -= c / mass
                if b != FRAME:
                    row[2 * at[b]] += k / mass
                    row[2 * at[b] + 1] += c / mass
        load, reading = [0.0] * count, [0.0] * count
        load[at[self.top]] = (more if self.top == self.crystal else 1.0) / self.masses[self.top]
        reading[at[self.crystal]] = 1.0 / more
        if self.base != FRAME:
            reading[at[self.base]] -= 1.0 / more
        return Assembled(np.array(rows), np.array(load), np.array(reading), at[self.top])
