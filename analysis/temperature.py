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

from analysis.campaign import Campaign, Quantity, Shot, Sphere, Surface

Material = TypeVar("Material", Sphere, Surface)


def at_temperature_of_shots(campaign: Campaign) -> tuple[Campaign, tuple[str, ...]]:
    """Return a campaign whose stated moduli are those at the temperature of their shots.

    Parameters
    ----------
    campaign : Campaign
        As stated.

    Returns
    -------
    campaign : Campaign
        Itself where no coefficient is stated; else without coefficients, so that doing it again
        changes nothing.
    told : tuple of str
        What had to be assumed, in words.
    """
    spheres, of_spheres = _moved(campaign, campaign.spheres, "sphere")
    surfaces, of_surfaces = _moved(campaign, campaign.surfaces, "surface")
    if spheres is campaign.spheres and surfaces is campaign.surfaces:
        return campaign, ()
    moved = dataclasses.replace(campaign, spheres=dict(spheres), surfaces=dict(surfaces))
    return moved, (*of_spheres, *of_surfaces)


def _moved(
    campaign: Campaign, materials: Mapping[str, Material], side: str
) -> tuple[Mapping[str, Material], list[str]]:
    told: list[str] = []
    found = {}
    for name, one in materials.items():
        coefficient, stated = one.modulus_coefficient_per_k, one.youngs_modulus_pa
        if coefficient is None:
            continue
        shots = [s for s in campaign.shots if getattr(s, side) == name]
        temperature = _temperature(campaign, shots)
        young = stated
        if stated is not None and temperature is not None:
            young = _at(stated, coefficient, temperature, one.modulus_temperature_c)
        elif stated is not None and shots:
            told.append(
                f"The temperature of the shots is not known: the modulus of the {side} {name} is "
                f"taken as stated for {one.modulus_temperature_c:g} degC, though it changes by "
                f"{100 * coefficient.value:.2g} % per kelvin."
            )
        found[name] = dataclasses.replace(
            one, youngs_modulus_pa=young, modulus_coefficient_per_k=None
        )
    return (materials if not found else {**materials, **found}), told


def _temperature(campaign: Campaign, shots: Sequence[Shot]) -> Quantity | None:
    """Return the mean temperature of shots; None where that of one of them is not known.

    Its u is that of the thermometer, which all shots share, and the spread from shot to shot.
    """
    around = [s.environment or campaign.environment for s in shots]
    common = campaign.environment.temperature_c if campaign.environment else None
    known = [(e.temperature_c if e else None) or common for e in around]
    told = [t for t in known if t is not None]
    if not told or len(told) < len(known):
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
