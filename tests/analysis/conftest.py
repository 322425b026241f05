"""An independent impact for the tests of the analysis: DOP853 in time, in its own coordinates.

Nothing here shares code with ``analysis.model``: the states are the sphere's and the crystal's
positions in time, the ring after lift-off is integrated too.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from analysis.campaign import Campaign, Quantity, Sensor, Shot, Sphere, Surface

GRAVITY = 9.80665
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Impact:
    """One impact as the paper writes it, Eqs 1-11. SI."""

    stiffness: float
    mass: float
    speed: float
    restitution: float
    crystal_mass: float | None = None
    crystal_stiffness: float = math.nan
    crystal_damping: float = math.nan
    gravity: float = GRAVITY
    rtol: float = 1e-12

    def rates(self, _t: float, state: Array) -> list[float]:
        """Return the derivative of (x, x', Delta, Delta')."""
        x, v, crystal, w = state
        delta, rate = x - crystal, v - w
        log = math.log(self.restitution)
        alpha = -math.sqrt(5) * log / math.sqrt(log**2 + math.pi**2)
        depth = max(delta, 0.0)
        elastic = self.stiffness * depth**1.5
        dissipated = alpha * math.sqrt(self.mass * self.stiffness) * depth**0.25 * rate
        sphere = self.gravity - (elastic + dissipated) / self.mass
        if self.crystal_mass is None:
            return [v, sphere, 0.0, 0.0]
        spring = self.crystal_stiffness * crystal + self.crystal_damping * w
        return [v, sphere, w, (elastic - spring) / self.crystal_mass]

    def solve(self, times: Array) -> tuple[Array, Array, float, float]:
        """Return elastic force and crystal compression at ``times``, contact time, rebound."""
        scale = (1.25 * self.mass * self.speed**2 / self.stiffness) ** 0.4

        def lift_off(_t: float, state: Array) -> float:
            return float(state[0] - state[2]) if _t > 0 else 1.0

        lift_off.terminal, lift_off.direction = True, -1  # type: ignore[attr-defined]
        contact = solve_ivp(
            self.rates,
            (0.0, 50 * scale / self.speed),
            [0.0, self.speed, 0.0, 0.0],
            method="DOP853",
            rtol=self.rtol,
            atol=1e-14 * scale,
            events=lift_off,
            dense_output=True,
        )
        end, last = float(contact.t[-1]), contact.y[:, -1]
        force, crystal = np.zeros(times.size), np.zeros(times.size)
        during = (times >= 0) & (times <= end)
        states = contact.sol(times[during])
        force[during] = self.stiffness * np.maximum(states[0] - states[2], 0.0) ** 1.5
        crystal[during] = states[2]
        after = times > end
        if self.crystal_mass is not None and after.any():
            mass, k, mu = self.crystal_mass, self.crystal_stiffness, self.crystal_damping
            ring = solve_ivp(
                lambda _t, s: [s[1], -(k * s[0] + mu * s[1]) / mass],
                (end, float(times[-1])),
                last[2:],
                method="DOP853",
                rtol=self.rtol,
                atol=1e-14 * max(abs(crystal).max(), 1e-300),
                dense_output=True,
            )
            crystal[after] = ring.sol(times[after])[0]
        return force, crystal, end, -float(last[1])


CELL = {"crystal_mass": 0.0354, "crystal_stiffness": 4.16e8, "crystal_damping": 560.0}
COMPLIANCE_M_PER_V = 1.2e-8
RATE_HZ = 1e6
PRE_SAMPLES = 900


def reduced(one: tuple[float, float], two: tuple[float, float]) -> float:
    """Return E* of two (E, nu)."""
    return 1 / ((1 - one[1] ** 2) / one[0] + (1 - two[1] ** 2) / two[0])


@dataclass
class Truth:
    """A rig whose every number is known, and a maker of its recordings."""

    moduli: dict[str, tuple[float, float]] = field(
        default_factory=lambda: {
            "acetal": (3.15e9, 0.35),
            "hdpe": (1.08e9, 0.35),
            "polycarbonate": (2.2e9, 0.37),
            "specimen": (1.5e9, 0.34),
        }
    )
    spheres: dict[str, tuple[float, float]] = field(
        default_factory=lambda: {"acetal": (4.76e-3, 6.116e-4), "hdpe": (4.76e-3, 4.232e-4)}
    )
    cell: dict[str, float] = field(default_factory=lambda: dict(CELL))
    noise_v: float = 1.5e-3
    ar1: float = 0.6
    speed_repeatability: float = 0.003
    seed: int = 1

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng(self.seed)

    def stiffness(self, sphere: str, surface: str) -> float:
        """Return K of a pair."""
        radius = self.spheres[sphere][0]
        return 4 / 3 * math.sqrt(radius) * reduced(self.moduli[sphere], self.moduli[surface])

    def noise(self, samples: int) -> Array:
        """Return AR(1) noise."""
        white = self.rng.standard_normal(samples + 200) * self.noise_v * math.sqrt(1 - self.ar1**2)
        return np.asarray(lfilter([1.0], [1.0, -self.ar1], white))[200:]

    def shot(
        self, sphere: str, surface: str, height_m: float, restitution: float, samples: int = 4200
    ) -> Shot:
        """Return one recording with its own speed, touch-down and noise."""
        nominal = math.sqrt(2 * GRAVITY * height_m)
        speed = nominal * (1 + self.speed_repeatability * self.rng.standard_normal())
        start = -(PRE_SAMPLES + self.rng.uniform(0, 1)) / RATE_HZ
        times = start + np.arange(samples) / RATE_HZ
        impact = Impact(
            self.stiffness(sphere, surface),
            self.spheres[sphere][1],
            speed,
            restitution,
            rtol=1e-9,
            **self.cell,
        )
        _, crystal, _, rebound = impact.solve(times)
        ratio = rebound / speed + 0.005 * self.rng.standard_normal()
        return Shot(
            name=f"{sphere} on {surface} from {height_m * 1e3:.1f} mm",
            signal=crystal / COMPLIANCE_M_PER_V + 0.01 + self.noise(samples),
            sample_rate_hz=RATE_HZ,
            trigger_index=PRE_SAMPLES + 6,
            sphere=sphere,
            surface=surface,
            drop_height_m=height_m,
            restitution=Quantity(ratio, 0.005),
        )

    def sensor(self, relative_u: float = 0.03) -> Sensor:
        """Return a certificate whose values are off by draws of its uncertainty."""
        off = 1 + relative_u * self.rng.standard_normal(4)
        values = (
            COMPLIANCE_M_PER_V,
            self.cell["crystal_mass"],
            self.cell["crystal_stiffness"],
            self.cell["crystal_damping"],
        )
        q = [Quantity(v * o, v * relative_u) for v, o in zip(values, off, strict=True)]
        return Sensor(q[0], q[1], q[2], q[3])

    def campaign(
        self,
        pairs: tuple[tuple[str, str], ...] = (
            ("acetal", "polycarbonate"),
            ("hdpe", "polycarbonate"),
            ("acetal", "specimen"),
            ("hdpe", "specimen"),
        ),
        heights_m: tuple[float, ...] = (0.012, 0.03, 0.06),
        unknown: tuple[str, ...] = ("specimen",),
    ) -> Campaign:
        """Return a campaign whose references are stated within their uncertainty."""

        def stated(name: str) -> Quantity | None:
            if name in unknown:
                return None
            value = self.moduli[name][0]
            return Quantity(value * (1 + 0.02 * self.rng.standard_normal()), 0.02 * value)

        def ratio(name: str) -> Quantity:
            return Quantity(self.moduli[name][1], 0.01)

        shots = tuple(
            self.shot(sphere, surface, height, 0.78 + 0.02 * i)
            for i, (sphere, surface) in enumerate(pairs)
            for height in heights_m
        )
        return Campaign(
            shots=shots,
            spheres={
                n: Sphere(n, radius, mass, stated(n), ratio(n))
                for n, (radius, mass) in self.spheres.items()
            },
            surfaces={
                n: Surface(n, stated(n), ratio(n)) for n in self.moduli if n not in self.spheres
            },
            sensor=self.sensor(),
            gravity_m_per_s2=GRAVITY,
            speed_repeatability=self.speed_repeatability,
        )


@pytest.fixture(scope="session")
def impact() -> type[Impact]:
    """Return the independent impact."""
    return Impact


@pytest.fixture(scope="session")
def truth() -> type[Truth]:
    """Return the maker of synthetic campaigns."""
    return Truth


@pytest.fixture(scope="session")
def made(truth: type[Truth]) -> tuple[Truth, Campaign]:
    """Return one synthetic campaign of twelve drops with its truth."""
    rig = truth(seed=11)
    return rig, rig.campaign()


def _quantity(found: dict[str, float] | None) -> Quantity | None:
    return None if found is None else Quantity(found["value"], found["u"])


def _read(folder: Path) -> Campaign:
    """Read a campaign folder the plain way, so that the analysis is tested without the storage."""
    about: dict[str, Any] = json.loads((folder / "campaign.json").read_text())
    cell = about.get("sensor") or {}
    shots = []
    for entry in about["shots"]:
        codes = np.load(folder / entry["file"])
        scale = entry.get("volts_per_code") or 1.0
        shots.append(
            Shot(
                name=entry["file"],
                signal=codes.astype(float) * (scale if codes.dtype.kind in "iu" else 1.0),
                sample_rate_hz=entry["sample_rate_Hz"],
                trigger_index=entry["trigger_index"],
                quantity=entry.get("quantity", "voltage"),
                sphere=entry.get("sphere"),
                surface=entry.get("surface"),
                drop_height_m=entry.get("drop_height_m"),
                restitution=_quantity(entry.get("restitution")),
                quantum=entry.get("volts_per_code"),
            )
        )
    return Campaign(
        shots=tuple(shots),
        spheres={
            n: Sphere(
                n,
                d.get("radius_m"),
                d.get("mass_kg"),
                _quantity(d.get("youngs_modulus_Pa")),
                _quantity(d.get("poissons_ratio")),
            )
            for n, d in (about.get("spheres") or {}).items()
        },
        surfaces={
            n: Surface(
                n,
                _quantity(d.get("youngs_modulus_Pa")),
                _quantity(d.get("poissons_ratio")),
                coupon_mass_kg=d.get("coupon_mass_kg"),
            )
            for n, d in (about.get("surfaces") or {}).items()
        },
        sensor=Sensor(
            _quantity(cell.get("compliance_m_per_V")),
            _quantity(cell.get("crystal_mass_kg")),
            _quantity(cell.get("crystal_stiffness_N_per_m")),
            _quantity(cell.get("crystal_damping_N_s_per_m")),
            _quantity(cell.get("hsd_N_per_V")),
        ),
        gravity_m_per_s2=about.get("gravity_m_per_s2", GRAVITY),
        speed_repeatability=(about.get("release") or {}).get("speed_repeatability"),
    )


@pytest.fixture(scope="session")
def read_campaign_folder() -> Callable[[Path], Campaign]:
    """Return the plain reader of campaign folders."""
    return _read


@pytest.fixture(scope="session")
def shared_folder() -> Callable[[str], Path]:
    """Return a finder of shared recordings by path below the shared folder; skips where absent."""
    default = Path(__file__).resolve().parents[3] / "shared"
    shared = Path(os.environ.get("IMPACTD_SHARED", default))

    def find(path: str) -> Path:
        folder = shared / path
        if not (folder / "campaign.json").exists():
            pytest.skip(f"{folder} is not here; set IMPACTD_SHARED to the shared recordings")
        return folder

    return find


@pytest.fixture(scope="session")
def shared_campaign(
    shared_folder: Callable[[str], Path],
) -> Callable[[str], tuple[Campaign, dict[str, Any]]]:
    """Return a reader of shared recordings, with what is true of them."""

    def read(path: str) -> tuple[Campaign, dict[str, Any]]:
        folder = shared_folder(path)
        truth = folder / "truth.json"
        return _read(folder), json.loads(truth.read_text()) if truth.exists() else {}

    return read
