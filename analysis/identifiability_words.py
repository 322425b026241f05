"""The identifiability report in sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

NEVER = "never"
"""Of Poisson's ratio: no straight impact shows it."""


@dataclass(frozen=True)
class Asked:
    """A quantity as a direction in the space of the globals."""

    name: str
    words: str
    gradient: NDArray[np.float64]
    """d(quantity) / d(globals). Shape (g,)."""
    kind: str
    """``cell``, ``pair``, ``alone``, ``modulus``, ``delay`` or ``effect``."""
    pairs: tuple[str, ...] = ()
    """Pairs that could show it; empty where every shot does."""
    log: bool = True
    """Whether it is a logarithm."""


@dataclass(frozen=True)
class Split:
    """Whether the data separate the two moduli of a pair, and by which other pairs."""

    sphere: str
    surface: str
    u_open: float
    """u of ln(E'_sphere / E'_surface) with the two's own stated moduli taken away. [1]"""
    determined_by: str
    """``network``, ``stated`` or ``nothing``."""
    stated: tuple[str, ...]
    """Which of the two had a stated modulus."""

    @property
    def pair(self) -> str:
        """Return ``sphere/surface``."""
        return f"{self.sphere}/{self.surface}"


def _percent(u: float) -> str:
    """Return an uncertainty of a logarithm as people say it."""
    return f"+-{u:.2g} of its logarithm" if u > 1 else f"+-{100 * u:.2g} %"


def quantity_sentence(asked: Asked, u: float, u_prior: float | None, status: str) -> str:
    """Return what the shots say about one quantity.

    It says what to do where something can be done. ``u`` is the standard uncertainty after the fit.
    """
    size = _percent(u) if asked.log else f"+-{u:.2g}"
    before = ""
    if u_prior is not None:
        before = f" (stated: {_percent(u_prior) if asked.log else f'+-{u_prior:.2g}'})"
    name = asked.words[0].upper() + asked.words[1:]
    if status == "shots":
        return f"{name} is fixed by the shots: {size}{before}."
    if status == "both":
        return f"{name} rests on the shots and on what was stated together: {size}{before}."
    if status == "not_identifiable":
        return f"{name} is not identifiable from these shots; {_remedy(asked)}."
    return (
        f"{name} is what was stated: {size}{before}; the shots hardly see it. {_why_prior(asked)}"
    ).strip()


def _why_prior(asked: Asked) -> str:
    if asked.kind == "modulus":
        return "More drops of other pairs with it would tell more."
    return ""


def _remedy(asked: Asked) -> str:
    if asked.kind == "pair":
        return "take a larger or softer sphere, so that the contact lasts longer"
    if asked.kind == "modulus":
        return (
            "drop a reference sphere on it, soft enough for a long contact, or this sphere on a "
            "reference surface"
        )
    if asked.kind in ("cell", "alone"):
        return "state the cell's certificate, or calibrate the cell"
    return "take its number as open"


def alone_sentence(u: float, u_prior: float | None, status: str) -> str:
    """Return what the shots say about M, k, mu and c apart from their sharp combinations.

    ``u`` is the standard uncertainty of ln M after the fit, which k, mu and c share; ``u_prior``
    what the four stated values together say about it.
    """
    why = (
        "apart from frequency, damping ratio and gain the crystal shows only in the recoil of the "
        "contact, a thousandth of the indentation."
    )
    name = "The crystal's mass M, and with it k, mu and c one by one,"
    if status == "not_identifiable":
        return f"{name} is not identifiable from these shots: {why} State the cell's certificate."
    if status == "prior":
        before = f", {_percent(u_prior)}" if u_prior is not None else ""
        return (
            f"{name} is what the certificate says{before} before and {_percent(u)} after: {why} "
            "Only the maker's value or a balance tells more."
        )
    return f"{name} is known to {_percent(u)} with the help of the recoil."


def network_sentence(pairs: Sequence[str]) -> str:
    """Return the moduli that the network of pairs separates."""
    return (
        f"Sphere and surface of {', '.join(pairs)} are told apart by other pairs; neither rests on "
        "its own stated value alone."
    )


def short_sentence(pair: str, share: float) -> str:
    """Return what a contact too short for the crystal does not show."""
    return (
        f"{pair}: not identifiable. The contact lasts {share:.2f} of the crystal's period; such a "
        "blow shows its impulse and the ring after it, not the contact law."
    )


def split_sentence(split: Split) -> str:
    """Return what tells the two moduli of a pair apart."""
    if split.determined_by == "network":
        return (
            f"{split.pair}: other pairs tell the two moduli apart; neither rests on its own stated "
            "value alone."
        )
    sphere, surface = split.sphere, split.surface
    alone = (
        f"{split.pair}: the shots give one number for the pair; how it divides between {sphere} "
        f"and {surface} "
    )
    if split.determined_by == "stated":
        return f"{alone}is not in them and follows from the stated {' and '.join(split.stated)}."
    return (
        f"{alone}is not in them, and neither is stated: drop a reference sphere on {surface} or "
        f"{sphere} on a reference surface."
    )


def nu_sentence(poisson: Sequence[tuple[str, float]]) -> str:
    """Return what Poisson's ratio does to Young's modulus."""
    worst, u = max(poisson, key=lambda one: one[1])
    size = "nothing" if math.isclose(u, 0.0) else f"up to {100 * u:.2g} % ({worst})"
    return (
        "Poisson's ratio is never seen by a straight impact: the shots know E/(1-nu^2), and Young's"
        f" modulus takes {size} of its uncertainty from the stated ratio."
    )
