"""A shot as the fit uses it: window, noise, frame, and its fixed parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import UNKNOWN_POISSONS_RATIO, Campaign, Rejected, Shot, Surface
from analysis.errors import ShotRejectedError
from analysis.fit.priors import Prior
from analysis.fit.window import Window, campaign_noise, cut, rail
from analysis.model.free_fall import speed_in_air
from analysis.model.impact_model import ShotFrame
from analysis.noise import NoiseModel
from analysis.quantisation import weights_at_rest

ASSUMED_REPEATABILITY = 0.02
"""Where a height is given without a repeatability; listed under ``assumptions`` when used."""
HEAVY_CRYSTAL = 1e4
"""Crystal over sphere mass where the crystal's mass is unknown: no recoil."""


@dataclass(frozen=True)
class FitShot:
    """A shot as the fit sees it."""

    shot: Shot
    window: Window
    frame: ShotFrame
    noise: NoiseModel
    fixed_gain: float | None
    """ln S where the gain is no parameter."""
    heavy_crystal: float | None
    """ln M where the crystal's mass is no parameter."""
    radius_m: float | None
    """Known where the pair's stiffness is a modulus."""
    speed_prior: Prior | None
    """On ln v0."""
    in_air: bool = False
    """Whether that is the speed of a fall through air (``kv2``) or through nothing."""
    air_resistance: float = 1.0
    """Drag of the air over that of the law. [1]"""
    mass_is_stated: bool = True
    """Else the sphere counts as 1 kg."""
    weights: NDArray[np.float64] | None = None
    """Of whitened samples of a coarse converter's record; None where every sample counts. [1]"""

    @property
    def in_si(self) -> bool:
        """Return whether speed, depth and stiffness over mass are in SI, not in reduced units.

        A force says m v, an acceleration v itself, volts without a gain neither.
        """
        if self.shot.quantity == "acceleration_m_per_s2":
            return True
        by_gain = self.shot.quantity == "force_N" or self.fixed_gain is None
        return by_gain and self.mass_is_stated

    @property
    def pair(self) -> str:
        """Return the pair's key."""
        return f"{self.shot.sphere or '?'}/{self.shot.surface or '?'}"

    @property
    def condition(self) -> tuple[str | None, str | None, float | None]:
        """Return what a repetition has in common with this shot: materials and height."""
        return self.shot.sphere, self.shot.surface, self.shot.drop_height_m

    @property
    def expected_squares(self) -> float:
        """Return the squares that noise leaves of `whiten` over its window: one a sample.

        Of a coarse converter's record there are fewer.
        """
        if self.weights is not None:
            return float(np.sum(self.weights**2))
        return float(self.frame.samples - self.noise.history)

    def whiten(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values over the window as independent ones, in units of their deviation.

        ``values``, shape (n,) or (n, k), are residuals or columns of a Jacobian. They are whitened
        as by `NoiseModel.whiten`; of a coarse converter's record a stretch at rest counts as one.
        """
        white = self.noise.whiten(values)
        return white if self.weights is None else np.asarray((white.T * self.weights).T)

    def products(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the inner products of rows over the window, in units of the noise.

        Of shape (k, k) for the k rows of what `whiten` makes of them; not finite where a row is
        not. [1]
        """
        with np.errstate(over="ignore", invalid="ignore"):
            if self.weights is None:
                return self.noise.products(rows)
            white = self.whiten(rows.T)
            return np.asarray(white.T @ white)


def under_noise(item: FitShot, noise: NoiseModel) -> FitShot:
    """Return a shot as it would be seen under another noise."""
    return replace(item, noise=noise, weights=_weights(item.window, noise))


def _weights(window: Window, noise: NoiseModel) -> NDArray[np.float64] | None:
    if noise.coarse is None:
        return None
    memory = float(1.0 - noise.coefficients.sum()) * noise.rms / noise.innovation_rms
    return weights_at_rest(window.signal[noise.history :], noise.coarse, memory=memory)


def poissons_ratio(surface: Surface | None) -> float:
    """Return a coupon's Poisson's ratio, or the usual one if nobody states it."""
    stated = surface.poissons_ratio if surface else None
    return (stated or UNKNOWN_POISSONS_RATIO).value


def _frame_of(shot: Shot, window: Window, campaign: Campaign, *, scaled: bool) -> ShotFrame:
    sphere = campaign.spheres.get(shot.sphere or "")
    surface = campaign.surfaces.get(shot.surface or "")
    mass = sphere.mass_kg if sphere else None
    gravity = campaign.gravity_m_per_s2
    if not scaled or (mass is None and shot.quantity != "acceleration_m_per_s2"):
        gravity = 0.0  # speeds are in reduced units: nothing to compare 9.8 m/s^2 with
    return ShotFrame(
        shot.sample_rate_hz,
        window.signal.size,
        mass or 1.0,
        gravity,
        window_start_s=window.first / shot.sample_rate_hz,
        radius_m=sphere.radius_m if sphere else None,
        drop_height_m=shot.drop_height_m,
        coupon_mass_kg=surface.coupon_mass_kg if surface else None,
        rail=rail(shot, window),
        sphere=shot.sphere,
        surface=shot.surface,
        coupon_poissons_ratio=poissons_ratio(surface),
    )


def _gain_of(shot: Shot, frame: ShotFrame, *, known_gain: bool) -> float | None:
    if shot.quantity == "force_N":
        return 0.0
    if shot.quantity == "acceleration_m_per_s2":
        return math.log(frame.mass_kg)
    return None if known_gain else 0.0


def log_speed_in_air(frame: ShotFrame, resistance: float = 1.0) -> float:
    """Return ln of a frame's speed of fall; minus infinite where nothing falls. [m/s]"""
    height, radius = frame.drop_height_m, frame.radius_m
    assert height is not None
    assert radius is not None
    if height <= 0:
        return -math.inf
    gravity = frame.gravity_m_per_s2
    speed = speed_in_air(height, radius, frame.mass_kg, gravity, resistance=resistance)
    return math.log(speed) if speed > 0 else -math.inf


def fit_shot(
    shot: Shot,
    campaign: Campaign,
    noise: NoiseModel,
    *,
    known_gain: bool,
    kv: bool,
    closed: bool = False,
    rides: bool = True,
    place: float = 0.0,
) -> FitShot:
    """Return a shot with everything about it that the fit does not vary.

    It is in reduced units if radius or mass are not known, or if volts cannot be turned into
    newtons (``known_gain`` false). ``kv`` says that the model has a crystal, ``closed`` that the
    sphere falls in air and, if it ``rides``, the coupon moves with the crystal (``kv2``); ``place``
    is from `places`.
    """
    sphere = campaign.spheres.get(shot.sphere or "")
    window = cut(shot)
    scaled = known_gain or shot.quantity != "voltage"
    frame = replace(_frame_of(shot, window, campaign, scaled=scaled), place=place)
    physical = sphere is not None and sphere.mass_kg and sphere.radius_m and shot.surface
    gain = _gain_of(shot, frame, known_gain=known_gain and bool(physical))
    speed, in_air = None, False
    mass_is_stated = sphere is not None and bool(sphere.mass_kg)
    if gain is not None and (
        shot.quantity == "voltage" or (shot.quantity == "force_N" and not mass_is_stated)
    ):
        pass  # the speed is in reduced units, and no height promises one
    elif shot.impact_speed_m_per_s is not None:
        measured = shot.impact_speed_m_per_s
        speed = Prior(math.log(measured.value), max(measured.u / measured.value, 1e-6))
    elif shot.drop_height_m is not None:
        mean = 0.5 * math.log(2 * campaign.gravity_m_per_s2 * shot.drop_height_m)
        scatter = campaign.speed_repeatability or ASSUMED_REPEATABILITY
        if shot.u_drop_height_m is not None:
            scatter = math.hypot(scatter, 0.5 * shot.u_drop_height_m.u / shot.drop_height_m)
        in_air = closed and bool(physical)
        if in_air:
            mean = log_speed_in_air(frame)
        speed = Prior(mean, scatter)
    heavy = None
    if kv and not physical:
        heavy = math.log(HEAVY_CRYSTAL * frame.mass_kg)
    elif closed and rides:
        frame = replace(frame, coupon_on_crystal_kg=frame.coupon_mass_kg or 0.0)
    return FitShot(
        shot,
        window,
        frame,
        noise,
        gain,
        heavy,
        sphere.radius_m if physical and scaled and sphere else None,
        speed,
        in_air,
        mass_is_stated=mass_is_stated,
        weights=_weights(window, noise),
    )


def noise_by_instrument(shots: tuple[Shot, ...]) -> dict[tuple[str, float], NoiseModel]:
    """Return one noise model per instrument, by (quantity, sample rate in Hz)."""
    groups: dict[tuple[str, float], list[Shot]] = {}
    for shot in shots:
        groups.setdefault((shot.quantity, shot.sample_rate_hz), []).append(shot)
    return {key: campaign_noise(group) for key, group in groups.items()}


def places(campaign: Campaign) -> dict[int, float]:
    """Return each shot's place in the order of time, by ``id``: -0.5 the first, 0.5 the last.

    Shots that were lost on the way in still took their time, but nobody knows when.
    """
    last = max(len(campaign.shots) - 1, 1)
    middle = 0.5 if len(campaign.shots) > 1 else 0.0
    return {id(shot): i / last - middle for i, shot in enumerate(campaign.shots)}


def usable_shots(campaign: Campaign) -> tuple[list[Shot], list[Rejected]]:
    """Return the shots that hold a pulse, and the others with the reason.

    What the campaign itself rejected comes first.
    """
    shots, rejected = [], list(campaign.rejected)
    for shot in campaign.shots:
        try:
            cut(shot)
        except ShotRejectedError as error:
            rejected.append(Rejected(shot.name, shot.path, str(error)))
        else:
            shots.append(shot)
    return shots, rejected


def gain_is_observable(campaign: Campaign, *, kv: bool) -> bool:
    """Tell whether volts can be turned into newtons at all: by certificate or by known speeds.

    False means reduced units. ``kv`` says whether the model has a crystal.
    """
    sensor = campaign.sensor
    if kv and sensor.compliance_m_per_v and sensor.crystal_stiffness_n_per_m:
        return True
    if not kv and sensor.hsd_n_per_v:
        return True
    return any(s.drop_height_m is not None or s.impact_speed_m_per_s for s in campaign.shots)
