"""A joint fit as numbers: which parameters there are, who shares them, what is known before.

Global parameters (all logarithms):

==============================  ===============================================================
``sensor.ln_S|ln_w|ln_z|ln_M``  the cell: gain, frequency, damping ratio, crystal mass
``sphere.<name>``               plane-strain modulus E' of a sphere's material [Pa]
``surface.<name>``              plane-strain modulus E' of a coupon [Pa]
``pair.<sphere>/<surface>``     contact stiffness K of a pair, where no moduli can be told apart
``<effect>.<parameter>``        an effect's number, in the effect's own coordinate; ``[name]`` behind
                                it where it belongs to a surface, a sphere or a pair
==============================  ===============================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from analysis.campaign import Campaign, Quantity, Rejected, Sensor, Shot, Sphere, Surface
from analysis.errors import AnalysisError, ShotRejectedError
from analysis.fit.window import Window, campaign_noise, cut
from analysis.model import solver
from analysis.model.hertz import plane_strain_modulus
from analysis.model.impact_model import SHARED, ImpactModel, ShotFrame
from analysis.noise import NoiseModel

UNKNOWN_LOG_U = 4.0
"""Width that only keeps an undetermined logarithm finite; e^4 either way is no information."""
ASSUMED_REPEATABILITY = 0.02
"""Where a height is given without a repeatability; listed under ``assumptions`` when used."""
HEAVY_CRYSTAL = 1e4
"""Crystal over sphere mass where the crystal's mass is unknown: no recoil."""


@dataclass(frozen=True)
class Prior:
    """A Gaussian on one global parameter."""

    mean: float
    u: float


@dataclass(frozen=True)
class FitShot:
    """A shot as the fit sees it.

    Attributes
    ----------
    shot : Shot
        The recording.
    window : Window
        The fitted part.
    frame : ShotFrame
        What stays fixed.
    noise : NoiseModel
        Of this shot's instrument.
    fixed_gain : float or None
        ln S where the gain is no parameter.
    heavy_crystal : float or None
        ln M where the crystal's mass is no parameter.
    radius_m : float or None
        Where the pair's stiffness is a modulus.
    speed_prior : Prior or None
        On ln v0.
    """

    shot: Shot
    window: Window
    frame: ShotFrame
    noise: NoiseModel
    fixed_gain: float | None
    heavy_crystal: float | None
    radius_m: float | None
    speed_prior: Prior | None

    @property
    def pair(self) -> str:
        """Return the pair's key."""
        return f"{self.shot.sphere or '?'}/{self.shot.surface or '?'}"


@dataclass
class JointProblem:
    """Everything a joint fit needs.

    Attributes
    ----------
    model : ImpactModel
        Base model.
    shots : list of FitShot
        In order of time.
    names : list of str
        Global parameters.
    start : ndarray, shape (g,)
        Filled in by ``analysis.fit.start``.
    prior_mean, prior_precision : ndarray, shape (g,), (g, g)
        Gaussian knowledge of the globals.
    by_pair : bool
        Whether pairs have a stiffness each instead of materials a modulus.
    rejected : list of Rejected
        Shots that could not be used.
    assumptions : list of str
        What had to be assumed, in words.
    """

    model: ImpactModel
    campaign: Campaign
    shots: list[FitShot]
    names: list[str]
    start: NDArray[np.float64]
    prior_mean: NDArray[np.float64]
    prior_precision: NDArray[np.float64]
    by_pair: bool
    rejected: list[Rejected] = field(default_factory=list)
    assumptions: list[str] = field(default_factory=list)

    def index(self, name: str) -> int | None:
        """Return a global's position, None where it is no parameter."""
        return self.names.index(name) if name in self.names else None

    def material_keys(self, shot: FitShot) -> tuple[str, str] | None:
        """Return the two moduli that make this shot's stiffness, None in pair mode."""
        if self.by_pair or shot.radius_m is None:
            return None
        return f"sphere.{shot.shot.sphere}", f"surface.{shot.shot.surface}"

    def effect_key(self, row: int, shot: FitShot) -> str:
        """Return the global's name of an effect's shared local parameter for this shot."""
        name = self.model.shared[row]
        effect, _, parameter = name.partition(".")
        found = next(e for e in self.model.effects if e.id == effect)
        scope = next(p.scope for p in found.parameters if p.name == parameter)
        owner = {"surface": shot.shot.surface, "sphere": shot.shot.sphere, "pair": shot.pair}
        return name if scope == "rig" else f"{name}[{owner[scope] or '?'}]"

    def shared_local(
        self, shot: FitShot, theta: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return a shot's shared local parameters and their derivative by the globals.

        Parameters
        ----------
        shot : FitShot
            The shot.
        theta : ndarray, shape (g,)
            Globals.

        Returns
        -------
        values : ndarray, shape (s,)
            In the order of ``model.shared``.
        chain : ndarray, shape (s, g)
            d values / d theta.
        """
        names = self.model.shared
        values = np.zeros(len(names))
        chain = np.zeros((len(names), len(self.names)))
        keys = self.material_keys(shot)
        if keys is None:
            j = self.names.index(f"pair.{shot.pair}")
            values[0], chain[0, j] = theta[j], 1.0
        else:
            assert shot.radius_m is not None
            j, k = (self.names.index(key) for key in keys)
            inverse = math.exp(-theta[j]) + math.exp(-theta[k])
            values[0] = math.log(4 / 3 * math.sqrt(shot.radius_m)) - math.log(inverse)
            chain[0, j] += math.exp(-theta[j]) / inverse
            chain[0, k] += math.exp(-theta[k]) / inverse
        for row, name in enumerate(names[1:], start=1):
            column = self.index(f"sensor.{name}")
            if row >= len(SHARED[self.model.kind]):
                column = self.names.index(self.effect_key(row, shot))
                values[row], chain[row, column] = theta[column], 1.0
            elif name == "ln_S" and shot.fixed_gain is not None:
                values[row] = shot.fixed_gain
            elif name == "ln_M" and shot.heavy_crystal is not None:
                values[row] = shot.heavy_crystal
            else:
                assert column is not None
                values[row], chain[row, column] = theta[column], 1.0
        return values, chain


def sensor_transform() -> NDArray[np.float64]:
    """Return T with ln(M, k, mu, c) = T ln(S, w, z, M) + (0, 0, ln 2, 0). Shape (4, 4)."""
    return np.array([[0, 0, 0, 1], [0, 2, 0, 1], [0, 1, 1, 1], [1, -2, 0, -1]], dtype=float)


SENSOR_OFFSET = np.array([0.0, 0.0, math.log(2.0), 0.0])
SENSOR_FIELDS = (
    "crystal_mass_kg",
    "crystal_stiffness_n_per_m",
    "crystal_damping_n_s_per_m",
    "compliance_m_per_v",
)


def _sensor_prior(sensor: Sensor) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return (precision, precision @ mean) in ln(S, w, z, M) from what is known of M, k, mu, c."""
    transform = sensor_transform()
    known = [getattr(sensor, name) for name in SENSOR_FIELDS]
    logs = np.array([math.log(q.value) if q else 0.0 for q in known]) - SENSOR_OFFSET
    if sensor.covariance is not None and all(known):
        inner = np.linalg.inv(sensor.covariance)
    else:
        relative = [max(q.u / q.value, 1e-6) if q else math.inf for q in known]
        inner = np.diag([r**-2 for r in relative])
    precision = transform.T @ inner @ transform
    return precision, transform.T @ inner @ logs


def modulus_prior(modulus: Quantity | None, ratio: Quantity | None) -> Prior | None:
    """Return the prior on ln E' of a material with a stated modulus.

    Parameters
    ----------
    modulus, ratio : Quantity or None
        Young's modulus [Pa] and Poisson's ratio.

    Returns
    -------
    Prior or None
        None where the modulus is to be found. An unknown ratio counts as 0.35 +- 0.1.
    """
    if modulus is None:
        return None
    nu = ratio or Quantity(0.35, 0.1)
    u_nu = 2 * nu.value * nu.u / (1 - nu.value**2)
    u = math.hypot(modulus.u / modulus.value, u_nu)
    return Prior(math.log(plane_strain_modulus(modulus.value, nu.value)), max(u, 1e-6))


def _frame_of(shot: Shot, window: Window, campaign: Campaign) -> ShotFrame:
    sphere = campaign.spheres.get(shot.sphere or "")
    surface = campaign.surfaces.get(shot.surface or "")
    mass = sphere.mass_kg if sphere else None
    gravity = campaign.gravity_m_per_s2
    if mass is None and shot.quantity != "acceleration_m_per_s2":
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
        coupon_thickness_m=surface.coupon_thickness_m if surface else None,
    )


def _gain_of(shot: Shot, frame: ShotFrame, *, known_gain: bool) -> float | None:
    if shot.quantity == "force_N":
        return 0.0
    if shot.quantity == "acceleration_m_per_s2":
        return math.log(frame.mass_kg)
    return None if known_gain else 0.0


def _fit_shot(
    shot: Shot, campaign: Campaign, noise: NoiseModel, *, known_gain: bool, kv: bool
) -> FitShot:
    sphere = campaign.spheres.get(shot.sphere or "")
    window = cut(shot)
    frame = _frame_of(shot, window, campaign)
    physical = sphere is not None and sphere.mass_kg and sphere.radius_m and shot.surface
    speed = None
    if shot.drop_height_m is not None:
        mean = 0.5 * math.log(2 * campaign.gravity_m_per_s2 * shot.drop_height_m)
        speed = Prior(mean, campaign.speed_repeatability or ASSUMED_REPEATABILITY)
    heavy = None
    if kv and not physical:
        heavy = math.log(HEAVY_CRYSTAL * frame.mass_kg)
    gain = _gain_of(shot, frame, known_gain=known_gain and bool(physical))
    return FitShot(
        shot,
        window,
        frame,
        noise,
        gain,
        heavy,
        sphere.radius_m if physical and sphere else None,
        speed,
    )


def _noise_by_instrument(shots: tuple[Shot, ...]) -> dict[tuple[str, float], NoiseModel]:
    groups: dict[tuple[str, float], list[Shot]] = {}
    for shot in shots:
        groups.setdefault((shot.quantity, shot.sample_rate_hz), []).append(shot)
    return {key: campaign_noise(group) for key, group in groups.items()}


def _usable(campaign: Campaign) -> tuple[list[Shot], list[Rejected]]:
    shots, rejected = [], list(campaign.rejected)
    for shot in campaign.shots:
        try:
            cut(shot)
        except ShotRejectedError as error:
            rejected.append(Rejected(shot.name, "", str(error)))
        else:
            shots.append(shot)
    return shots, rejected


def _gain_is_observable(campaign: Campaign, *, kv: bool) -> bool:
    """Tell whether volts can be turned into newtons at all: by certificate or by known speeds."""
    sensor = campaign.sensor
    if kv and sensor.compliance_m_per_v and sensor.crystal_stiffness_n_per_m:
        return True
    if not kv and sensor.hsd_n_per_v:
        return True
    return any(s.drop_height_m is not None for s in campaign.shots)


def _material_priors(campaign: Campaign, shots: list[FitShot]) -> dict[str, Prior | None]:
    found: dict[str, Prior | None] = {}
    for item in shots:
        sides: tuple[tuple[str, str | None, Sphere | Surface | None], ...] = (
            ("sphere", item.shot.sphere, campaign.spheres.get(item.shot.sphere or "")),
            ("surface", item.shot.surface, campaign.surfaces.get(item.shot.surface or "")),
        )
        for side, name, material in sides:
            known = None
            if material is not None:
                known = modulus_prior(material.youngs_modulus_pa, material.poissons_ratio)
            found.setdefault(f"{side}.{name}", known)
    return found


def build(campaign: Campaign, model: ImpactModel, *, by_pair: bool = False) -> JointProblem:
    """Return the joint problem of a campaign, start values still missing.

    Parameters
    ----------
    campaign : Campaign
        Recordings and what is known.
    model : ImpactModel
        Base model.
    by_pair : bool
        Give each pair its own stiffness instead of each material a modulus: for single shots, whose
        moduli are told apart later, by the network.

    Returns
    -------
    JointProblem
        Ready for ``analysis.fit.start``.

    Raises
    ------
    AnalysisError
        If no shot can be used.
    """
    kv = model.kind == solver.KV
    usable, rejected = _usable(campaign)
    if not usable:
        reasons = "; ".join(f"{r.name}: {r.reason}" for r in rejected[:3])
        raise AnalysisError(f"No shot of this campaign can be used ({reasons or 'it has none'}).")
    noise = _noise_by_instrument(tuple(usable))
    gain = _gain_is_observable(campaign, kv=kv)
    shots = [
        _fit_shot(s, campaign, noise[s.quantity, s.sample_rate_hz], known_gain=gain, kv=kv)
        for s in usable
    ]
    names: list[str] = []
    sensor_names = ("ln_S", "ln_w", "ln_z", "ln_M") if kv else ("ln_S",)
    for name in sensor_names:
        if name == "ln_S" and all(s.fixed_gain is not None for s in shots):
            continue
        if name == "ln_M" and all(s.heavy_crystal is not None for s in shots):
            continue
        names.append(f"sensor.{name}")
    problem = JointProblem(
        model, campaign, shots, names, np.zeros(0), np.zeros(0), np.zeros((0, 0)), by_pair, rejected
    )
    priors = _material_priors(campaign, [s for s in shots if problem.material_keys(s)])
    names.extend(sorted(priors))
    names.extend(sorted({f"pair.{s.pair}" for s in shots if problem.material_keys(s) is None}))
    for row in range(len(SHARED[model.kind]), len(model.shared)):
        names.extend(sorted({problem.effect_key(row, s) for s in shots}))
    _set_priors(problem, priors)
    if any(s.speed_prior for s in shots) and campaign.speed_repeatability is None:
        problem.assumptions.append(
            f"No speed repeatability given: {ASSUMED_REPEATABILITY:.0%} from shot to shot assumed."
        )
    return problem


def _set_priors(problem: JointProblem, priors: dict[str, Prior | None]) -> None:
    size = len(problem.names)
    precision = np.zeros((size, size))
    weighted = np.zeros(size)
    sensor = problem.campaign.sensor
    if problem.model.kind == solver.KV:
        at = [problem.index(f"sensor.{n}") for n in ("ln_S", "ln_w", "ln_z", "ln_M")]
        if None not in at:  # in reduced units the cell's certificate says nothing
            full, load = _sensor_prior(sensor)
            precision[np.ix_(at, at)] = full
            weighted[at] = load
    elif sensor.hsd_n_per_v is not None and "sensor.ln_S" in problem.names:
        j = problem.names.index("sensor.ln_S")
        relative = max(sensor.hsd_n_per_v.u / sensor.hsd_n_per_v.value, 1e-6)
        precision[j, j] = relative**-2
        weighted[j] = math.log(sensor.hsd_n_per_v.value) / relative**2
    for name, prior in priors.items():
        if prior is not None:
            j = problem.names.index(name)
            precision[j, j] = prior.u**-2
            weighted[j] = prior.mean / prior.u**2
    problem.prior_precision = precision
    problem.prior_mean = weighted  # information vector until the start completes it
