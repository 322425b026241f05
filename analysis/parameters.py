"""The names of parameters, each with the fields that it was built from.

A name is a ``str``: a second list of descriptions would have to be cut, widened and sorted beside
every list of names, while a name that carries its fields is compared, looked up and written as JSON
like the key it is.

==============================  =========  ====================  ===================  =============
key                             kind       owner                 quantity             group
==============================  =========  ====================  ===================  =============
``sensor.<quantity>``           sensor                           ``ln_S``, ...
``sphere.<owner>``              sphere     a sphere's material   ``ln_E``
``surface.<owner>``             surface    a coupon's material   ``ln_E``
``pair.<owner>``                pair       ``sphere/surface``    ``ln_K``
``rebound.<quantity>``          rebound                          ``seen_ms``
``<owner>.<quantity>[<group>]`` effect     an effect's id        its own number       whose it is
``input.<quantity>.<owner>``    input      its sphere, surface   ``mass``, ...
``<owner>.<quantity> [<group>]`` law       an effect's id        a column of the law  a pair
==============================  =========  ====================  ===================  =============

A field that a kind does not have is empty, and so is what stands between it and the rest of a key.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypeAlias

Side: TypeAlias = Literal["sphere", "surface"]
Kind: TypeAlias = Literal[Side, "sensor", "pair", "rebound", "effect", "input", "law"]

SIDES: tuple[Side, ...] = ("sphere", "surface")
_INPUT = "input."


# no eq: two names are equal if their keys are, as any other strings
@dataclass(frozen=True, eq=False, repr=False)
class ParameterName(str):
    """A parameter's name, as the functions below make it."""

    key: str
    """The string itself, as documents have it."""
    kind: Kind
    owner: str = ""
    quantity: str = ""
    group: str = ""

    def __new__(cls, key: str, *_: str, **__: str) -> ParameterName:
        """Return the string; the fields follow."""
        return super().__new__(cls, key)

    @property
    def short(self) -> str:
        """Return it without its owner: the quantity, and the group if there is one."""
        return f"{self.quantity}[{self.group}]" if self.group else self.quantity

    @property
    def is_modulus(self) -> bool:
        """Whether it is ln E' of a material."""
        return self.kind in SIDES

    @property
    def side(self) -> Side:
        """Which of the two bodies the material of a modulus is."""
        assert self.kind in SIDES
        return self.kind

    def is_of(self, effect_id: str, parameter: str | None = None) -> bool:
        """Tell whether it is a number of this effect, by default any; of whatever group."""
        mine = self.kind == "effect" and self.owner == effect_id
        return mine and parameter in (None, self.quantity)


def of_sensor(quantity: str) -> ParameterName:
    """Return the name of a number of the cell, such as ``ln_S``."""
    return ParameterName(f"sensor.{quantity}", "sensor", quantity=quantity)


def of_material(side: Side, material: str | None) -> ParameterName:
    """Return the name of a material's modulus."""
    return ParameterName(f"{side}.{material}", side, owner=str(material), quantity="ln_E")


def of_pair(pair: str) -> ParameterName:
    """Return the name of the stiffness of a pair ``sphere/surface``."""
    return ParameterName(f"pair.{pair}", "pair", owner=pair, quantity="ln_K")


def of_rebound(quantity: str) -> ParameterName:
    """Return the name of a number of how the rebounds were seen."""
    return ParameterName(f"rebound.{quantity}", "rebound", quantity=quantity)


def of_effect(effect_id: str, parameter: str, group: str = "") -> ParameterName:
    """Return the name of an effect's number; without a group that of a shot's local parameter."""
    behind = f"[{group}]" if group else ""
    return ParameterName(f"{effect_id}.{parameter}{behind}", "effect", effect_id, parameter, group)


def of_input(quantity: str, owner: str | None) -> ParameterName:
    """Return the name of a stated number; the owner is None for what all shots share."""
    key = _INPUT + (quantity if owner is None else f"{quantity}.{owner}")
    return ParameterName(key, "input", owner or "", quantity)


def of_law(effect_id: str, column: str, pair: str) -> ParameterName:
    """Return the name of how far an effect's law is wrong along a column, of a pair."""
    return ParameterName(f"{effect_id}.{column} [{pair}]", "law", effect_id, column, pair)


def input_in_document(key: str) -> ParameterName:
    """Return the name of a stated number from its key in the document of a fit or calibration."""
    quantity, point, owner = key.removeprefix(_INPUT).partition(".")
    return of_input(quantity, owner if point else None)


def key_in_moduli(name: ParameterName, names: Iterable[str]) -> str:
    """Return how ``moduli`` of a result calls one of some moduli: by its material.

    Preceded by its side where a sphere and a surface have the same material.
    """
    both = {of_material(side, name.owner) for side in SIDES} <= set(names)
    return f"{name.kind}:{name.owner}" if both else name.owner


GAIN, FREQUENCY, DAMPING, CRYSTAL = map(of_sensor, ("ln_S", "ln_w", "ln_z", "ln_M"))
CELL = (GAIN, FREQUENCY, DAMPING, CRYSTAL)
"""The cell: gain, natural frequency, damping ratio, crystal's mass."""
