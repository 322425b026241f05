r"""Stated moduli at the temperature of the shots.

.. math:: \ln E(T) = \ln E_0 + a (T - T_0)

with the relative coefficient a of a data sheet or of a measurement. Validity: tens of kelvins about
:math:`T_0` and away from transitions, where a is a number. A modulus that is to be found needs no
coefficient: it is that at the temperature of its shots.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

from analysis.campaign import Campaign, Environment, Quantity, Shot, Sphere, Surface

Material = TypeVar("Material", Sphere, Surface)


@dataclasses.dataclass(frozen=True)
class Landing:
    """What fell on what, and at which temperature; ``None`` where it is not known. [degC]"""

    sphere: str | None
    surface: str | None
    temperature_c: Quantity | None


def at_temperature_of_shots(campaign: Campaign) -> tuple[Campaign, tuple[str, ...]]:
    """Return a campaign whose stated moduli are those at the temperature of their shots.

    It is the same campaign if no coefficient is stated; else it has no coefficients, so that doing
    it again changes nothing. What had to be assumed is told in words.
    """
    landings = [Landing(s.sphere, s.surface, _temperature(campaign, s)) for s in campaign.shots]
    spheres, of_spheres = spheres_at(campaign.spheres, landings)
    surfaces, of_surfaces = surfaces_at(campaign.surfaces, landings)
    if spheres is campaign.spheres and surfaces is campaign.surfaces:
        return campaign, ()
    moved = dataclasses.replace(campaign, spheres=dict(spheres), surfaces=dict(surfaces))
    return moved, (*of_spheres, *of_surfaces)


def spheres_at(
    spheres: Mapping[str, Sphere], landings: Sequence[Landing]
) -> tuple[Mapping[str, Sphere], list[str]]:
    """Return spheres whose stated moduli are those at the temperature of their landings.

    They are the same object if no coefficient is stated; else they have no coefficients. What had
    to be assumed is told in words.
    """
    return _moved(spheres, [(one.sphere, one.temperature_c) for one in landings], "sphere")


def surfaces_at(
    surfaces: Mapping[str, Surface], landings: Sequence[Landing]
) -> tuple[Mapping[str, Surface], list[str]]:
    """Return surfaces whose stated moduli are those at the temperature of their landings.

    See `spheres_at`.
    """
    return _moved(surfaces, [(one.surface, one.temperature_c) for one in landings], "surface")


def _moved(
    materials: Mapping[str, Material], seen: Sequence[tuple[str | None, Quantity | None]], side: str
) -> tuple[Mapping[str, Material], list[str]]:
    told: list[str] = []
    found = {}
    for name, one in materials.items():
        coefficient, stated = one.modulus_coefficient_per_k, one.youngs_modulus_pa
        if coefficient is None:
            continue
        temperatures = [temperature for of, temperature in seen if of == name]
        temperature = _mean(temperatures)
        young = stated
        if stated is not None and temperature is not None:
            young = _at(stated, coefficient, temperature, one.modulus_temperature_c)
        elif stated is not None and temperatures:
            told.append(
                f"The temperature of the shots is not known: the modulus of the {side} {name} is "
                f"taken as stated for {one.modulus_temperature_c:g} degC, though it changes by "
                f"{100 * coefficient.value:.2g} % per kelvin."
            )
        found[name] = dataclasses.replace(
            one, youngs_modulus_pa=young, modulus_coefficient_per_k=None
        )
    return (materials if not found else {**materials, **found}), told


def _temperature(campaign: Campaign, shot: Shot) -> Quantity | None:
    """Return a shot's own temperature, else that of the campaign."""
    around = (shot.environment or Environment()).completed_by(campaign.environment)
    return around.temperature_c


def _mean(temperatures: Sequence[Quantity | None]) -> Quantity | None:
    """Return the mean of temperatures; None where one of them is not known.

    Its u is that of the thermometer, which all shots share, and the spread from shot to shot.
    """
    told = [t for t in temperatures if t is not None]
    if not told or len(told) < len(temperatures):
        return None
    values = np.array([t.value for t in told])
    u = math.hypot(max(t.u for t in told), float(values.std()))
    return Quantity(float(values.mean()), u)


def _at(
    stated: Quantity, coefficient: Quantity, temperature: Quantity, stated_c: float
) -> Quantity:
    away = temperature.value - stated_c
    value = stated.value * math.exp(coefficient.value * away)
    u = math.hypot(stated.u / stated.value, coefficient.value * temperature.u, away * coefficient.u)
    return Quantity(value, u * value)
