"""A score test for structure in the residual.

The tests of a residual ask overlapping columns, so their p-values go together. To first order all
of them are known functions of the whitened noise: noise is drawn, all tests are asked, and what
their smallest p-values do says how many independent tests they amount to.

Noise of density 1/f or 1/f^2 moves every order of a baseline, the first most, by amounts that stand
in a known ratio. Its size is only known to a limit: quiet stretches are short. So a baseline that
moves says nothing as long as some such part that they allow moves it like that. Hum moves one order
and hardly the next.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from scipy.linalg import solve_triangular
from scipy.sparse import csr_array
from scipy.stats import chi2 as chi2_distribution
from scipy.stats import norm

from analysis.aliases import Array
from analysis.diagnosis.basis.form_error import discrepancy
from analysis.diagnosis.basis.proposals import Proposal, asked_by_their_column, scopes_of
from analysis.diagnosis.basis.time_course import BASELINE_ORDERS
from analysis.diagnosis.criteria import CRITERIA
from analysis.diagnosis.linearised import (
    Explained,
    Linearised,
    LinearisedShot,
    Projection,
    linearise,
    p_of,
)
from analysis.fit import joint
from analysis.fit.freed_inputs import (
    is_far_whatever_is_stated,
    lacks_more_than_numbers,
    numbers_of_shots,
)
from analysis.fit.inputs import AIR_RESISTANCE, LAW
from analysis.fit.problem import JointProblem
from analysis.fit.stated_to_first_order import fitted_with_stated_numbers
from analysis.noise_slow import FURTHEST_CORNER, LEAST_CORNER
from analysis.quiet_spectrum import drift_basis, slow_powers

Part = tuple[str, str]
"""Family, and whose a coefficient is."""

WANDER = ("baseline", "shot")
"""What slow noise does too, which may be too faint to be seen before the trigger."""
ASKED: tuple[Part, ...] = (
    ("response", "rig"), ("response", "surface"), ("static", "rig"), ("dynamic", "rig"),
    ("contact", "rig"), ("contact", "surface"), ("contact", "sphere"),
    ("loss", "rig"), ("loss", "surface"), ("cell", "surface"), ("cell", "order"), ("cell", "shot"),
    ("speed", "height"), ("speed", "shot"), ("locked", "rig"), ("locked", "pair"),
    ("alternate", "shot"), WANDER,
)  # fmt: skip
INEXACT = (LAW, "pair")
"""Asked of a model with effects: is one of its laws wrong by more than laws are?"""

DRAWS, TAIL = 1000, 0.1
"""The number of tests is fitted to the lower decile of the draws' smallest p-values.
Derived: a verdict is asked of the tail, where overlapping tests agree less than in the middle; the
decile of 1000 draws tells the number, and so a p-value, to a tenth: sqrt(0.9 / (0.1 x 1000))."""
SEED = 20_311
"""Any: it is kept, so that the same records have the same p-value."""
CORNERS_TRIED = 40
"""Corners of slow noise, evenly over their logarithm: 1.4 times the last or less."""
LEAST_SHARE = 1e-6
"""Of an order, that a shot's own parameters must leave of it for it to be seen."""


@dataclass(frozen=True)
class ScoreTest:
    """The answer to the one question."""

    p_value: float
    """Of the strongest family, corrected for having asked them all: uniform where there is only
    noise, at least the chance of it where there is structure."""
    answers: dict[Part, Explained]
    """What each family explains."""
    surplus: float = 0.0
    """Whitened squares beyond the noise's own, where these are too many for noise. No family need
    have seen them."""
    of_effects: dict[Part, Explained] = dataclasses.field(default_factory=dict)
    """What each effect of one number explains to first order, of a model without effects. One
    column shows at a third of the squares that a family of 30 columns needs."""
    tests: int = 1
    """How many the p-value is corrected for; some need not have been asked."""

    @property
    def structured(self) -> bool:
        """Whether the residual is more than noise."""
        return self.p_value < CRITERIA.false_alarm_rate

    @property
    def left(self) -> float:
        """Return the whitened squares that are no noise, as far as anything sees them."""
        asked = (*self.answers.values(), *self.of_effects.values())
        return max(self.surplus, *(a.gain - a.dof for a in asked))

    @property
    def strongest(self) -> Explained:
        """Return the family with the smallest p-value, then the largest fall per number."""
        return min(self.answers.values(), key=lambda e: (e.p_value, -e.gain / max(e.dof, 1)))

    def is_more_than(self, won: float) -> bool:
        """Tell whether structure is left if other numbers explain this many squares.

        What these and a family explain together is no less than the family alone: so the family
        explains, on top of them, at most ``won`` squares less.
        """
        asked = self.answers | self.of_effects
        clearest = asked[self.clearest]
        p = p_of(max(0.0, clearest.gain - won), clearest.dof) * self.tests
        return p < CRITERIA.false_alarm_rate

    @property
    def clearest(self) -> Part:
        """Return the test with the smallest p-value, then the largest fall of the squares."""
        asked = self.answers | self.of_effects
        return min(asked, key=lambda part: (asked[part].p_value, -asked[part].gain))


def check_residual(problem: JointProblem, fitted: joint.Fitted) -> tuple[Linearised, ScoreTest]:
    """Return the residual of a fit, linearised, and whether it is more than noise.

    What an effect's law may be wrong by (`analysis.diagnosis.basis.form_error`) is no structure,
    nor is what masses, radii and heights explain that differ from their statements by what these
    allow: such an answer is that of the fit in which they are uncertain.
    """
    return _beyond_statements(problem, fitted, _asked_all)


def shows_structure(problem: JointProblem, fitted: joint.Fitted, part: Part) -> bool:
    """Tell whether one test alone finds `check_residual`'s structure: no other is needed then.

    That takes a quarter of the time. False says nothing.
    """
    if part == WANDER:  # what this test says rests on more than its own p-value
        return False
    return _beyond_statements(problem, fitted, partial(_asked_one, part=part))[1].structured


Asked = Callable[[JointProblem, joint.Fitted], tuple[Linearised, ScoreTest]]
"""Linearises the residual of a fit and tests it."""


def _tried(problem: JointProblem) -> list[Proposal]:
    """Return the effects that are asked by their own column."""
    # beside another effect, whose law may be wrong, a direction is no evidence of one more
    return [] if problem.model.effects else asked_by_their_column(problem)


def _asked_all(problem: JointProblem, fitted: joint.Fitted) -> tuple[Linearised, ScoreTest]:
    tried = _tried(problem)
    linearised = linearise(problem, fitted, tried, inexact=discrepancy(problem, fitted))
    return linearised, run_score_test(linearised, tried)


def _asked_one(
    problem: JointProblem, fitted: joint.Fitted, *, part: Part
) -> tuple[Linearised, ScoreTest]:
    """Return what one test says, corrected for all by Bonferroni's bound."""
    tried, family = _tried(problem), part[0]
    own = [one for one in tried if one.key == family]
    wanted = () if own or family == LAW else (family,)
    linearised = linearise(
        problem, fitted, own, wanted=wanted, inexact=discrepancy(problem, fitted)
    )
    if family not in linearised.families:
        return linearised, ScoreTest(1.0, {})
    answer = linearised.explain(*part, heldout=False)
    tests = len(_parts_asked(linearised, tried))
    return linearised, ScoreTest(min(1.0, answer.p_value * tests), {part: answer}, tests=tests)


def _parts_asked(linearised: Linearised, tried: Sequence[Proposal]) -> list[Part]:
    asked = (*ASKED, INEXACT) if linearised.wrong_by else ASKED
    return [*asked, *((one.key, scope) for one in tried for scope in scopes_of(one.effect))]


def _beyond_statements(
    problem: JointProblem, fitted: joint.Fitted, ask: Asked
) -> tuple[Linearised, ScoreTest]:
    """Return what some tests say, where they do so whatever stated numbers explain."""
    linearised, found = ask(problem, fitted)
    if not found.structured or lacks_more_than_numbers(problem, fitted.cost):
        return linearised, found
    free = fitted_with_stated_numbers(problem, fitted, needless=found.is_more_than)
    if free is None:
        return linearised, found  # every number is exact, or brings too little
    won = fitted.cost - free[1].cost
    if free[1].converged and found.is_more_than(won):
        return linearised, found
    again, freed = ask(*free)
    if not freed.structured:
        return again, freed
    # the columns are those of the fit, which takes statements as exact; the chance allows for them
    return linearised, dataclasses.replace(found, p_value=freed.p_value)


def is_far_from_noise(problem: JointProblem, fitted: joint.Fitted) -> bool:
    """Tell whether a fit leaves so much that no test is needed, by noise that was measured."""
    measured = all(item.noise.is_measured for item in problem.shots)
    return measured and is_far_whatever_is_stated(problem, fitted)


def takes_statements_as_exact(problem: JointProblem) -> bool:
    """Tell whether stated numbers may be off that are not yet among the parameters.

    The air's drag alone explains no surplus that is clear.
    """
    stated = [one for one in numbers_of_shots(problem) if one.kind != AIR_RESISTANCE]
    return bool(stated) and not problem.inputs


def has_clear_surplus(linearised: Linearised) -> bool:
    """Tell whether a residual has so many squares that `run_score_test` finds structure anyway."""
    _, p_of_surplus = _surplus(linearised)
    return p_of_surplus * (len(ASKED) + 1) < CRITERIA.false_alarm_rate


def run_score_test(linearised: Linearised, tried: Sequence[Proposal] = ()) -> ScoreTest:
    """Return whether a fit's residual has structure, asking all families and some effects.

    Bonferroni's correction is an upper bound. Where it calls a residual structured already, it
    stands; else the chance is asked of noise that is drawn.
    """
    parts = _parts_asked(linearised, tried)
    every = {part: linearised.explain(*part, heldout=False) for part in parts}
    wander = every[WANDER]
    if wander.p_value < CRITERIA.false_alarm_rate:
        p = max(wander.p_value, p_of_wander(linearised))
        every[WANDER] = dataclasses.replace(wander, p_value=p)
    surplus, p_of_surplus = _surplus(linearised)
    least = min(a.p_value for a in every.values())
    p = min(p_of_surplus, least) * len(every)
    if not p < CRITERIA.false_alarm_rate:
        p = family_wise(least, linearised, parts)
    keys = {one.key for one in tried}
    answers = {part: one for part, one in every.items() if part[0] not in keys}
    of_effects = {part: one for part, one in every.items() if part[0] in keys}
    return ScoreTest(p, answers, surplus, of_effects, len(every))


def chance_of(samples: float) -> float:
    """Return the squares beyond so many samples' own that are no sign of more than noise. [1]"""
    return CRITERIA.excess_deviations * math.sqrt(2.0 * samples)


def _surplus(linearised: Linearised) -> tuple[float, float]:
    """Return the squares beyond the noise's own and their p-value; 0 and 1 of what noise may have.

    Samples and level are uncertain as those of Gaussian noise are; nothing is said where some level
    is a guess, not measured on quiet stretches.
    """
    noises = {id(shot.item.noise): shot.item.noise for shot in linearised.shots}.values()
    if any(not noise.is_measured for noise in noises):
        return 0.0, 1.0
    seen = sum(shot.item.expected_squares for shot in linearised.shots)
    sigma = math.sqrt(2.0 / seen + 2.0 / sum(noise.samples for noise in noises))
    share = linearised.chi2 / seen - 1.0
    least = CRITERIA.little, CRITERIA.deviations * sigma
    if not share > max(least):
        return 0.0, 1.0
    return share * seen, float(norm.sf(share / sigma))


# -- many tests ------------------------------------------------------------------------------------
def family_wise(p_value: float, linearised: Linearised, parts: Sequence[Part]) -> float:
    r"""Return the chance that noise makes any of some tests as clear as the clearest.

    .. math:: p = 1 - (1 - p_{min})^m

    of m independent tests; m is fitted to the lower decile of the smallest p-values of drawn noise.
    Uniform between 0 and 1 where there is only noise. Source: F. Dudbridge and B. P. C.
    Koeleman, Am. J. Hum. Genet. 75 (2004) 424.
    """
    return float(-np.expm1(independent_tests(linearised, parts) * np.log1p(-p_value)))


def independent_tests(linearised: Linearised, parts: Sequence[Part]) -> float:
    """Return how many independent tests some overlapping ones amount to, from 1 to their number."""
    scores = _drawn_scores(linearised)
    least = np.min([_p_values(linearised, scores, part) for part in parts], axis=0)
    decile = min(float(np.quantile(least, TAIL)), 1.0 - 1e-12)  # of tests that see nothing it is 1
    found = math.log1p(-TAIL) / math.log1p(-decile)
    return min(max(found, 1.0), float(len(parts)))


def _drawn_scores(linearised: Linearised) -> list[Array]:
    """Return what each shot's score would be in noise, globals fitted to it.

    Each of shape (s + q, draws): shared parameters, then columns.
    """
    rng = np.random.default_rng(SEED)
    whole = linearised.precision.copy()
    load = _drawn(rng, whole)
    chains = [shot.wide_chain for shot in linearised.shots]
    scores = []
    for shot, chain in zip(linearised.shots, chains, strict=True):
        score = _drawn(rng, shot.matrix)
        whole += chain.T @ shot.matrix @ chain
        load += chain.T @ score
        scores.append(score)
    moved = np.linalg.lstsq(whole, load, rcond=None)[0]
    return [
        score - shot.matrix @ (chain @ moved)
        for score, shot, chain in zip(scores, linearised.shots, chains, strict=True)
    ]


def _drawn(rng: np.random.Generator, matrix: Array) -> Array:
    """Return draws of a Gaussian with a covariance. Shape (n, draws)."""
    scale = np.sqrt(np.maximum(np.diag(matrix), 0.0))
    unit = np.where(scale > 0.0, scale, 1.0)
    # rounding and a coarse converter's stretches leave eigenvalues below zero
    values, vectors = np.linalg.eigh(matrix / np.outer(unit, unit))
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    return np.asarray(scale[:, None] * (root @ rng.standard_normal((scale.size, DRAWS))))


def _p_values(linearised: Linearised, scores: list[Array], part: Part) -> Array:
    """Return the p-values of one test in every draw. Shape (draws,)."""
    family, scope = part
    if scope == "shot":
        at, _ = linearised.families[family]
        gain, dof = linearised.of_each_shot(at, scores)
    else:
        system = linearised.system([part])
        load = np.zeros((system.whole.shape[0], DRAWS))
        for chain, score in zip(system.chains, scores, strict=True):
            load += np.asarray(csr_array(chain.T) @ score)  # next to nothing of a chain is not zero
        # the globals' own load is what fitting them has brought to nothing, priors included
        load[: system.globals_] = 0.0
        found = Projection(system.whole, system.globals_)
        gain, dof = found.gain(load), found.rank
    return np.asarray(chi2_distribution.sf(gain, dof)) if dof else np.ones(DRAWS)


# -- baselines -------------------------------------------------------------------------------------
def p_of_wander(linearised: Linearised) -> float:
    """Return how likely baselines move as they do by slow noise that may be there unseen.

    For the slow part that suits best among those which the quiet stretches allow. The squares of N
    shots along an order, over what is expected, are chi-square over N; of the ratios' deviance,
    N sum(r - 1 - ln r), the smallest over all allowed corners is compared with chi-square of as
    many degrees of freedom as there are orders, which is on the safe side. Validation: baselines
    moved by noise and by hum in ``tests/analysis/diagnosis``.
    """
    at, _ = linearised.families[WANDER[0]]
    by_noise: dict[int, list[LinearisedShot]] = {}
    for shot in linearised.shots:
        by_noise.setdefault(id(shot.item.noise), []).append(shot)
    deviance = sum(_deviance(shots, at) for shots in by_noise.values())
    return float(chi2_distribution.sf(deviance, len(at) * len(by_noise)))


def _deviance(shots: list[LinearisedShot], at: list[int]) -> float:
    """Return the smallest deviance of one instrument's baselines over all allowed corners."""
    by_order = np.array([_by_order(shot, at) for shot in shots])
    noise = shots[0].item.noise
    slow = np.array([_slow_powers(shot.item.window.signal.size, noise.slope) for shot in shots])
    # from none to the largest corner that is allowed [1/sample]
    largest = FURTHEST_CORNER if noise.corner_below is None else noise.corner_below
    corners = np.geomspace(LEAST_CORNER, max(largest, LEAST_CORNER), CORNERS_TRIED)
    least = np.inf
    for corner in np.append(0.0, corners):
        expected = (1.0 + corner**noise.slope * slow) / (1.0 + noise.corner**noise.slope * slow)
        ratio = np.maximum(np.mean(by_order / expected, axis=0), 1e-300)
        least = min(least, len(shots) * float(np.sum(ratio - 1.0 - np.log(ratio))))
    return least


def _by_order(shot: LinearisedShot, at: list[int]) -> Array:
    """Return what each order explains beyond those before it, in units of the noise. Shape (q,)."""
    inner = shot.matrix[np.ix_(at, at)]
    scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    values, vectors = np.linalg.eigh(inner / np.outer(scale, scale))
    sound = (vectors * np.maximum(values, LEAST_SHARE)) @ vectors.T
    root = np.linalg.cholesky(sound)
    return np.square(solve_triangular(root, shot.vector[at] / scale, lower=True))


@lru_cache(maxsize=256)
def _slow_powers(samples: int, slope: int) -> Array:
    """Return how much noise of density 1/f^slope moves each order of a baseline. Shape (q,)."""
    orders = drift_basis(samples, max(BASELINE_ORDERS))[:, list(BASELINE_ORDERS)]
    return slow_powers(orders, slope)
