"""Are an effect's fitted numbers such as that effect can have?"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from analysis.diagnosis.criteria import CRITERIA
from analysis.effects.effect import Effect, ShotContext
from analysis.fit import joint
from analysis.fit.physical_range import effect_out_of_range
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.window import quiet_part

Array = NDArray[np.float64]


def _alike(sizes: Array, groups: Sequence[float | None]) -> bool:
    """Tell whether the shots of a group have much of a signal in common."""
    members = [[at for at, g in enumerate(groups) if g == one] for one in set(groups)]
    if len(sizes) < CRITERIA.free_signal.fewest_phases * len(members):
        return False
    common = sum(len(own) * float((sizes[own].mean(axis=0) ** 2).sum()) for own in members)
    return common > CRITERIA.free_signal.common_phase_share * max(float((sizes**2).sum()), 1e-300)


def left_its_range(problem: JointProblem, fitted: joint.Fitted, effect: Effect) -> bool:
    """Tell whether an effect's numbers are such as no such effect can have.

    Parameters
    ----------
    problem, fitted : JointProblem, Fitted
        A fit that has the effect.
    effect : Effect
        Which one.

    Returns
    -------
    bool
        A number outside its bounds, see `analysis.fit.physical_range`; or a free signal that is
        alike in all shots, or in those of a height, or absent before the trigger: the mains know
        neither when a sphere falls nor when it was let go.
    """
    if effect.basis is not None:
        first = problem.model.nuisances.index(f"{effect.id}.basis0")
        sizes = fitted.nuisances[:, first : first + effect.basis_size]
        heights = [shot.shot.drop_height_m for shot in problem.shots]
        locked = _alike(sizes, [None] * len(sizes)) or _alike(sizes, heights)
        return locked or not is_there_before(problem.shots, effect, sizes)
    return any(effect_out_of_range(problem, fitted, effect))


def is_there_before(shots: list[FitShot], effect: Effect, sizes: Array) -> bool:
    """Tell whether the quiet parts hold as much of a signal as its sizes in the windows promise.

    Parameters
    ----------
    shots : list of FitShot
        With their quiet parts.
    effect : Effect
        With a basis that needs nothing of a shot but its sampling.
    sizes : ndarray, shape (shots, q)
        As fitted in the windows. [unit of the signal]

    Returns
    -------
    bool
        True where no quiet part is long enough to tell.

    Notes
    -----
    Whitened power a coefficient, least squares in the quiet part against the fitted sizes in the
    window; chance brings 1 with a relative deviation of sqrt(2 / coefficients).
    """
    assert effect.basis is not None
    seen, promised = [], []
    for item, size in zip(shots, sizes, strict=True):
        quiet, samples = quiet_part(item.shot), item.window.signal.size
        if quiet.size < CRITERIA.free_signal.least_quiet_samples:
            continue
        context = _sampled(item.frame.sample_rate_hz)
        columns = np.column_stack([np.ones(quiet.size), effect.basis(quiet.size, context)])
        basis, _ = np.linalg.qr(item.noise.whiten(columns))
        found = basis[:, 1:].T @ item.noise.whiten(quiet - quiet.mean())
        seen.append(float(found @ found) / size.size)
        inside = item.whiten(effect.basis(samples, context) @ size)
        share = min(1.0, quiet.size / samples) ** 3  # of what is slow, a slope is left
        promised.append(share * float(inside @ inside) / size.size)
    if not seen:
        return True
    deviation = math.sqrt(2.0 / (len(seen) * sizes.shape[1]))
    chance = 1.0 - CRITERIA.free_signal.quiet_power_deviations * deviation
    return bool(np.mean(seen) - chance > CRITERIA.free_signal.quiet_power_share * np.mean(promised))


def _sampled(rate_hz: float) -> ShotContext:
    nothing = math.nan
    return ShotContext(rate_hz, 0.0, nothing, nothing, nothing, nothing, None, None, None, nothing)
