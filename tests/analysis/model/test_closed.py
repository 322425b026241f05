"""The closed base model against DOP853 at rtol 1e-12, and its limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from analysis.model import solver
from analysis.model.hertz import closed_damping_coefficient, damping_coefficient
from analysis.model.impact_model import ShotFrame, model_named
from analysis.paper.contact import Cell, Drop, contact_history

from ..closed_reference import ClosedImpact, linear_force_end

RATE_HZ = 1e6
START_S = -20.3e-6
SAMPLES = 700
TABLE3 = (0.0354, 4.16e8, 560.0)

CASES = {
    "acetal on polycarbonate": (1.37e8, 6.116e-4, 0.96, 0.82, 3.6e-3),
    "acetal on aluminium": (1.9e8, 6.116e-4, 0.96, 0.82, 8.1e-3),
    "steel on aluminium, fast": (4.2e9, 0.878e-3, 2.0, 0.95, 8.1e-3),
    "neoprene on ptfe": (7.5e6, 1.981e-4, 0.96, 0.6, 5e-3),
    "neoprene, slow": (7.5e6, 1.981e-4, 0.2, 0.6, 5e-3),
    "strong damping": (1.37e8, 6.116e-4, 0.96, 0.1, 3.6e-3),
    "almost loss-free": (1.37e8, 6.116e-4, 0.96, 0.9999, 3.6e-3),
    "loss-free": (1.37e8, 6.116e-4, 0.96, 1.0, 3.6e-3),
    "no coupon": (1.37e8, 6.116e-4, 0.96, 0.8, 0.0),
    "a coupon as heavy as the crystal": (1.37e8, 6.116e-4, 0.96, 0.8, 0.0354),
}


def _trace(
    contact: tuple[float, ...], cell: tuple[float, ...], coupon: float, **how: float
) -> tuple[np.ndarray, float, float, float]:
    """Return what `solver.trace` does; ``contact`` is K, m, v0 and alpha, ``cell`` M, k and mu."""
    K, m, v, alpha = contact
    M, k, mu = cell
    return solver.trace(
        kind=solver.KV,
        sample_times_start_s=START_S,
        sample_interval_s=1 / RATE_HZ,
        samples=SAMPLES,
        stiffness=K,
        mass_kg=m,
        speed_m_per_s=v,
        alpha=alpha,
        crystal_mass_kg=M + coupon,
        crystal_stiffness_n_per_m=k,
        crystal_damping_n_s_per_m=mu,
        **{"closed": True} | how,  # type: ignore[arg-type]
    )


def _errors(
    contact: tuple[float, ...], restitution: float, cell: tuple[float, ...], coupon: float
) -> tuple[float, float, float]:
    """Return errors of trace, contact time and rebound; ``contact`` is K, m and v0."""
    whole = (*contact, closed_damping_coefficient(restitution))
    times = START_S + np.arange(SAMPLES) / RATE_HZ
    expected, end, leaves = ClosedImpact(*whole, *cell, coupon).solve(times)
    signal, duration, rebound, _ = _trace(whole, cell, coupon)
    error = float(np.abs(signal - expected).max() / np.abs(expected).max())
    return error, abs(duration / end - 1), abs(rebound - leaves) / contact[2]


@pytest.mark.parametrize("case", CASES)
def test_closed_model_agrees_with_the_reference_to_a_millionth(case: str) -> None:
    """Trace, contact time and rebound agree with DOP853 at rtol 1e-12 to 1e-6."""
    *contact, restitution, coupon = CASES[case]
    error, duration, rebound = _errors(tuple(contact), restitution, TABLE3, coupon)
    assert error <= 1e-6
    assert duration <= 1e-6
    assert rebound <= 1e-6


@settings(
    max_examples=20,
    deadline=None,
    derandomize=True,
    phases=[Phase.explicit, Phase.generate],  # shrinking would take minutes of DOP853
    suppress_health_check=[HealthCheck.too_slow],
)
@given(
    ln_duration=st.floats(math.log(1e-5), math.log(3e-4)),
    sphere=st.tuples(st.floats(1e-4, 2e-3), st.floats(0.25, 2.0)),
    restitution=st.floats(0.2, 1.0),
    phase=st.floats(0.3, 60.0),
    damping_ratio=st.floats(0.01, 1.5),
    crystal_over_sphere=st.floats(8.0, 500.0),
    coupon_over_crystal=st.floats(0.0, 1.0),
)
def test_closed_model_agrees_anywhere(
    *,
    ln_duration: float,
    sphere: tuple[float, float],
    restitution: float,
    phase: float,
    damping_ratio: float,
    crystal_over_sphere: float,
    coupon_over_crystal: float,
) -> None:
    """Over contact times, masses, speeds, losses, cells and coupons the error stays below 1e-6."""
    duration, (m, speed) = math.exp(ln_duration), sphere
    K = 1.25 * m * speed**2 / (duration * speed / 2.943275) ** 2.5
    M, omega0 = crystal_over_sphere * m, min(phase / duration, 6e5)
    cell = (M, M * omega0**2, 2 * damping_ratio * M * omega0)
    error, _, rebound = _errors((K, m, speed), restitution, cell, coupon_over_crystal * M)
    assert error <= 1e-6
    assert rebound <= 1e-6


@pytest.mark.parametrize("restitution", [0.2, 0.6, 0.85, 0.99, 0.9999])
def test_contact_ends_when_its_force_does(restitution: float) -> None:
    """At lift-off the total force is zero to 1e-9 of its peak, and it never pulled before."""
    found = contact_history(
        Drop(1.37e8, 6.116e-4, 0.96), restitution, Cell(0.039, 4.16e8, 560.0), steps=92, closed=True
    )
    total = found.elastic_n + found.dissipative_n
    assert abs(total[-1]) <= 1e-9 * total.max()
    assert total.min() >= -1e-9 * total.max()
    assert found.indentation_m[-1] > 0.0


@pytest.mark.parametrize("ratio", [0.01, 0.1, 0.5, 0.7, 0.75, 0.95])
def test_restitution_goes_with_the_damping_as_for_a_linear_dashpot(ratio: float) -> None:
    """The relation is Schwager and Poeschel's for the linear dashpot, by a change of variables."""
    restitution = linear_force_end(ratio)
    assert closed_damping_coefficient(restitution) == pytest.approx(math.sqrt(5) * ratio, rel=1e-9)


@pytest.mark.parametrize("restitution", [0.02, 0.1353, math.exp(-2), 0.3, 0.8, 0.999])
def test_restitution_comes_back_on_a_rigid_crystal(restitution: float) -> None:
    """On a crystal that does not move the sphere rebounds at eps of its speed."""
    alpha = closed_damping_coefficient(restitution)
    K, m, v = 1.37e8, 6.116e-4, 0.96
    _, _, rebound, _ = _trace(
        (K, m, v, alpha), (1e6, 1e17, 0.0), 0.0, gravity_m_per_s2=0.0, steps=400
    )
    assert rebound / v == pytest.approx(restitution, rel=1e-6)


def test_without_loss_closed_is_the_papers_coefficient() -> None:
    """At eps = 1 and above no force pulls, and Eq. 5 holds as it stands."""
    assert closed_damping_coefficient(1.0) == 0.0
    assert closed_damping_coefficient(1.02) == damping_coefficient(1.02)
    below, above = closed_damping_coefficient(1 - 1e-6), damping_coefficient(1 + 1e-6)
    assert below == pytest.approx(-above, rel=1e-5)


def test_without_loss_and_coupon_closed_is_kv() -> None:
    """With eps = 1 and no coupon third law and end of force change nothing."""
    case = ((1.37e8, 6.116e-4, 0.96, 0.0), TABLE3, 0.0)
    closed, open_ended = (_trace(*case, steps=200, closed=c)[0] for c in (True, False))
    np.testing.assert_array_equal(closed, open_ended)


FRAME = ShotFrame(1e6, 900, 6.116e-4, 9.80665, radius_m=4.76e-3, coupon_on_crystal_kg=3.6e-3)


def _local(names: tuple[str, ...]) -> np.ndarray:
    own = {
        "ln_K": math.log(1.37e8),
        "ln_S": math.log(5.0),
        "ln_w": math.log(math.sqrt(4.16e8 / 0.0354)),
        "ln_z": math.log(560.0 / (2 * math.sqrt(4.16e8 * 0.0354))),
        "ln_M": math.log(0.0354),
        "ln_v0": math.log(0.96),
        "ln_e": math.log(0.82),
        "t0_us": 100.3,
    }
    return np.array([own.get(n, 0.0) for n in names])


def test_named_model_is_the_closed_one() -> None:
    """``kv2`` puts the shot's coupon on the crystal and turns eps into alpha by the closed rule."""
    model = model_named("kv2")
    found = model.predict(_local(model.names), FRAME)
    times = (np.arange(FRAME.samples) - 100.3) / 1e6
    alpha = closed_damping_coefficient(0.82)
    reference = ClosedImpact(1.37e8, 6.116e-4, 0.96, alpha, *TABLE3, 3.6e-3)
    expected, _, rebound = reference.solve(times)
    expected *= 4.16e8 / 5.0
    assert np.abs(found.signal - expected).max() <= 1e-6 * expected.max()
    assert found.rebound_ratio == pytest.approx(rebound / 0.96, rel=1e-6)


def test_derivatives_are_those_of_central_differences() -> None:
    """The Jacobian of ``kv2`` agrees with central differences of its trace."""
    model = model_named("kv2")
    local = _local(model.names)
    steps = model.steps(local, FRAME)
    _, jacobian, gradient = model.linearise(local, FRAME)
    for j, name in enumerate(model.names):
        if name in {"seen_ms", "baseline"}:
            continue
        d = np.zeros(local.size)
        d[j] = 1e-4
        above, below = (model.predict(local + s * d, FRAME, steps=steps) for s in (1, -1))
        slope = (above.signal - below.signal) / 2e-4
        assert np.abs(jacobian[:, j] - slope).max() <= 2e-5 * max(np.abs(slope).max(), 1e-6)
        ratio = (above.rebound_ratio - below.rebound_ratio) / 2e-4
        assert gradient[j] == pytest.approx(ratio, abs=2e-5)
