"""The form every effect of the simulator has.

An effect is a class with an id, a slot, described parameters and the hooks it needs. A hook is
named by the moment it is called; the ones an effect leaves alone do nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from drivers.simulated.electronics import Stage
from drivers.simulated.impact import Mechanics


@dataclass(frozen=True)
class Parameter:
    """One number of an effect."""

    name: str
    unit: str
    low: float
    high: float
    """From barely visible (``low``) to large; a random size is drawn between them, even in the
    logarithm."""
    neutral: float
    """Value at which the effect does nothing."""
    meaning: str
    """In a few words."""
    either_sign: bool = False
    """A random value may also be negative."""


@dataclass
class Shot:
    """One release, as an effect sees it."""

    number: int
    """Releases so far on this rig."""
    sphere: str
    surface: str
    drop_height_m: float
    """Height asked for; effects of the release slot change it. [m]"""
    rng: np.random.Generator
    """Random numbers of this shot and this effect alone."""
    speed_factor: float = 1.0
    """Factor on the impact speed; effects of the release slot change it. [1]"""


Names = str | tuple[str, ...]
"""One material or several of a kind."""


@dataclass(frozen=True)
class Scope:
    """Where an effect acts; ``None`` means everywhere."""

    sphere: Names | None = None
    surface: Names | None = None
    """Names of the only spheres (``sphere``) and the only surfaces concerned; a tuple is kept
    sorted, and one of a single name as that name."""

    def __post_init__(self) -> None:
        """Keep names in order, so that equal scopes compare equal."""
        for side in ("sphere", "surface"):
            names = getattr(self, side)
            if isinstance(names, tuple):
                kept = tuple(sorted(set(names)))
                if not kept:
                    raise ValueError(f"A scope without any {side} acts nowhere; leave it out.")
                object.__setattr__(self, side, kept[0] if len(kept) == 1 else kept)

    def includes(self, sphere: str, surface: str) -> bool:
        """Return whether both names of a pair are concerned."""
        return _names(self.sphere, sphere) and _names(self.surface, surface)

    def to_json(self) -> dict[str, str | list[str]]:
        """Return only what is restricted: a name, or a list of several."""
        both = {"sphere": self.sphere, "surface": self.surface}
        return {
            side: list(names) if isinstance(names, tuple) else names
            for side, names in both.items()
            if names is not None
        }


def _names(wanted: Names | None, name: str) -> bool:
    return wanted is None or name in ((wanted,) if isinstance(wanted, str) else wanted)


@dataclass
class Effect:
    """Base of all effects: does nothing."""

    id: ClassVar[str] = ""
    slot: ClassVar[str] = ""
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    per_material: ClassVar[bool] = False  # a random draw may restrict it to some materials
    order: ClassVar[int] = 50  # place in the chain from crystal (0) to converter (100)
    fine_grid: ClassVar[bool] = False  # its stage needs the oversampled grid
    # Published forms of the same law; the first is the one of the paper's rig.
    forms: ClassVar[tuple[str, ...]] = ("",)
    # Those a closed rig has, and a drawn one draws from; none means all.
    sound_forms: ClassVar[tuple[str, ...]] = ()

    values: Mapping[str, float]
    """By name; all of them, no defaults. [SI]"""
    scope: Scope = field(default_factory=Scope)
    form: str = ""
    """Which published form of its law, one of ``forms``; left out, the first."""

    def __post_init__(self) -> None:
        """Refuse unknown, missing and non-finite parameters, and forms that there are not."""
        self.form = self.form or self.forms[0]
        if self.form not in self.forms:
            known = ", ".join(self.forms) if self.forms != ("",) else "none"
            raise ValueError(f"Effect {self.id!r} has no form {self.form!r}; it has {known}.")
        names = {p.name for p in self.parameters}
        if names != set(self.values):
            raise ValueError(
                f"Effect {self.id!r} takes exactly {sorted(names)}, not {sorted(self.values)}."
            )
        for p in self.parameters:
            if math.isnan(self.values[p.name]):
                raise ValueError(f"Effect {self.id!r}: {p.name} is not a number.")

    @classmethod
    def draw(cls, rng: np.random.Generator) -> dict[str, float]:
        """Return parameter values of random size, by name. [SI]"""
        values = {}
        for p in cls.parameters:
            size = math.exp(rng.uniform(math.log(p.low), math.log(p.high)))
            negative = p.either_sign and rng.random() < 0.5
            values[p.name] = -size if negative else size
        return values

    @classmethod
    def form_on(cls, rig: str) -> str:
        """Return the form that a rig of this name has when none is drawn.

        ``"paper"`` takes the first form, any other the first sound one.
        """
        return cls.forms[0] if rig == "paper" or not cls.sound_forms else cls.sound_forms[0]

    @classmethod
    def draw_form(
        cls, rng: np.random.Generator, values: dict[str, float]
    ) -> tuple[str, dict[str, float]]:
        """Return a form at random, and the values that go with it.

        ``values`` are as drawn for the first form.
        """
        return str(rng.choice(cls.sound_forms or cls.forms)), values

    @classmethod
    def neutral_values(cls) -> dict[str, float]:
        """Return the values at which nothing happens."""
        return {p.name: p.neutral for p in cls.parameters}

    def to_json(self) -> dict[str, object]:
        """Return id, slot, parameters and scope as the sealed truth states them."""
        form = {"form": self.form} if self.form else {}
        return {
            "id": self.id,
            "slot": self.slot,
            **form,
            "parameters": dict(self.values),
            "scope": self.scope.to_json(),
        }

    def at_release(self, shot: Shot) -> None:
        """Change how the sphere leaves the tube: its height or its speed factor."""

    def before_impact(self, mechanics: Mechanics, shot: Shot, speed_m_per_s: float) -> None:
        """Change the bodies before an impact is integrated.

        The shot is the release this impact belongs to, the speed that at touch-down.
        """

    def stage(self, shot: Shot) -> Stage | None:
        """Return this effect's part of the chain behind the crystal, at rest; None for none."""
        return None

    def ambient(self, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return what is on the line at a rig time even when nothing falls. [V]

        It is added to the signal.
        """
        return None

    def after_release(self, shot: Shot, t_s: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return what a release puts on the line by itself, impact or not. [V]

        ``t_s`` is the time since then, >= 0. It is added to the signal.
        """
        return None

    def conversion(self) -> NDArray[np.uint16] | None:
        """Return the converter's code for each ideal code, ``None`` when it is ideal."""
        return None
