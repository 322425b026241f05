"""The network summed by groups is the network of all its observations."""

from __future__ import annotations

import numpy as np
import pytest

from analysis import PairObservation
from analysis.campaign import Quantity, Sphere, Surface
from analysis.moduli_checks import consistency
from analysis.moduli_network import build, errors_of_rows, grouped, solve

NU = Quantity(0.35, 0.01)
SPHERES = {
    "a": Sphere("a", 4.76e-3, 6e-4, Quantity(3.1e9, 6e7), NU),
    "b": Sphere("b", 4.76e-3, 6e-4, None, NU),
}
SURFACES = {"s": Surface("s", Quantity(69e9, 1e9), NU), "x": Surface("x", None, NU)}


def _drawn(shots: int) -> list[PairObservation]:
    """Return shots with uncertainties and slopes of their own, under three calibrations."""
    rng = np.random.default_rng(3)
    true = {"a": 3.2e9, "b": 1.1e9, "s": 70e9, "x": 2.1e9}
    found = []
    for number in range(shots):
        sphere, surface = str(rng.choice(["a", "b"])), str(rng.choice(["s", "x"]))
        u = float(np.exp(rng.uniform(np.log(1e-4), np.log(3e-3))))
        log = -np.log(1 / true[sphere] + 1 / true[surface]) + u * rng.standard_normal()
        found.append(
            PairObservation(
                sphere,
                surface,
                float(log),
                u,
                rng.normal(0.5, 0.3, 4),
                f"shot {number}",
                "kv",
                float(rng.uniform(1e-3, 5e-3)),
                str(rng.choice(["certificate", "1", "2"])),
                {f"input.mass.{sphere}": float(rng.normal(0, 2e-3)), "input.height_offset": 1e-3},
            )
        )
    return found


@pytest.mark.parametrize("shots", [1, 7, 400])
def test_groups_leave_nothing_out(shots: int) -> None:
    """Optimum, covariance and chi2 are those of the equations written row by row."""
    observations = _drawn(shots)
    root = np.random.default_rng(4).normal(0, 3e-3, (4, 4))
    system = build(observations, SPHERES, SURFACES, {"1": root @ root.T, "2": np.eye(4) * 1e-4})
    x, covariance = solve(system, grouped(system))

    n, rows = len(system.names), np.arange(shots)
    common = np.array([errors_of_rows(system, e)[rows] for e in np.eye(x.size)])[n:].T
    left, right = system.left[system.pair], system.right[system.pair]
    a, b = np.exp(-x[left]), np.exp(-x[right])
    design = np.zeros((shots, x.size))
    design[rows, left], design[rows, right] = a / (a + b), b / (a + b)
    design[:, n:] = common
    residual = system.observed + np.log(a + b) - common @ x[n:]
    normal = design.T @ (system.weight[:, None] * design) + system.precision
    d = x - system.mean
    uphill = system.precision @ d - design.T @ (system.weight * residual)

    assert float(np.linalg.solve(normal, uphill) @ uphill) < 1e-8  # in squares of u
    assert covariance == pytest.approx(np.linalg.inv(normal), rel=1e-6, abs=1e-14)
    unknown = [j for j, prior in enumerate(system.priors) if prior is None]
    weak = float(np.sum(d[unknown] ** 2 * np.diag(system.precision)[unknown]))
    dense = float(system.weight @ residual**2 + d @ system.precision @ d) - weak
    assert consistency(system).chi2 == pytest.approx(dense, rel=1e-9, abs=1e-9)
