r"""No law is exact: the small discrepancy that every effect of a model brings with it.

An effect e adds to a shot its own signal, model less the model without it at the same parameters:

.. math:: d_e(t) = f(t; \theta) - f_{-e}(t; \theta)

Another published form of the same law would add nearly the same. What it adds beside, :math:`\Phi
c`, is linear in coefficients :math:`c \sim N(0, \epsilon^2)` of each pair, along columns as large
as the signal itself:

===============  ===================================================================================
column           what of the law is inexact
===============  ===================================================================================
``size k``       :math:`P_k(u)\, d_e`, k = 0..3: its size, and how that changes in its course
``delay``        :math:`T\, \dot d_e`: when it comes
``<number>``     :math:`s\, \partial f / \partial p`: each of its numbers, which is one number for
                 all pairs where the law is exact; s makes the column as large as the signal
===============  ===================================================================================

P are Legendre's polynomials; u runs from -1 to 1 as the signal's squares pass, because a contact's
law acts during the contact, a coupler's long after it, and a second touch later still. T is the
contact time. The signal is all of what the law adds, not the part that nothing else imitates: what
a modulus imitates of an error of the law moves the modulus. Coefficients belong to a pair: a form
is chosen once, but how two forms differ depends on the two bodies, and hardly on the height, with
which the signal has changed already.

A signal of free size in every shot (hum) is no law and has none.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from analysis.aliases import Array
from analysis.campaign import Uncertainty
from analysis.effects.effect import Effect
from analysis.fit.first_order_input import FirstOrderInput
from analysis.fit.inputs import LAW
from analysis.fit.joint import Fitted
from analysis.fit.problem import FitShot, JointProblem
from analysis.parameters import ParameterName, of_law

HIGHEST_ORDER = 3
"""Of the polynomials: a signal's start, middle and end apart, no single sample."""

LAW_U = 0.01
"""Standard uncertainty of a law, as a share of its effect's own signal along each column of its
discrepancy. Measured: a tape whose damping is a loss factor, fitted with one damping constant, is
wrong by 1.0 % in rms and 2.4 % at most; another law of loss by 5.7 %, and is told."""

Places = NDArray[np.intp]


@dataclass(frozen=True)
class Discrepancy:
    """What the inexactness of a model's laws may add to each shot."""

    names: list[ParameterName]
    """Of the w coefficients."""
    columns: list[Array]
    """For each shot, shape (n, q). [unit of the signal]"""
    speeds: list[Array]
    """What each column adds to the promised ln v0, shape (q,)."""
    places: list[Places]
    """Whose coefficient each column has, among ``names``, shape (q,)."""
    sharing: Mapping[int, Sequence[int]]
    """For the coefficient of an effect's number, those of all pairs that have this number."""
    u: float = LAW_U
    """Standard uncertainty of every coefficient."""

    @property
    def precision(self) -> Array:
        """Return what is known of the coefficients beforehand. Shape (w, w)"""
        return np.asarray(np.eye(len(self.names)) / self.u**2)

    def as_inputs(self, items: Sequence[FitShot]) -> tuple[FirstOrderInput, ...]:
        """Return the coefficients as inputs of a joint fit of these shots.

        Those of a number say how far each pair is from the mean of its pairs, because the mean is
        the number itself. A coefficient for the mean would have a straight column beside a curved
        model, and the fit would mistake the difference for information.
        """
        added: list[dict[float, Array]] = [{} for _ in self.names]
        faster: list[dict[float, float]] = [{} for _ in self.names]
        for item, columns, speeds, places in zip(
            items, self.columns, self.speeds, self.places, strict=True
        ):
            for column, speed, j in zip(columns.T, speeds.tolist(), places, strict=True):
                pairs = self.sharing.get(int(j))
                for k in (j,) if pairs is None else pairs:
                    share = float(j == k) - (0.0 if pairs is None else 1.0 / len(pairs))
                    added[k][item.frame.place] = share * column
                    faster[k][item.frame.place] = share * speed
        u = Uncertainty(self.u)
        return tuple(
            FirstOrderInput(
                LAW, name, 0.0, "1", u, f"{LAW}.{name.owner}", {}, signal, speed, name.owner
            )
            for name, signal, speed in zip(self.names, added, faster, strict=True)
        )


@dataclass(frozen=True)
class _OfEffect:
    """One effect's columns of one shot, those of its numbers not yet scaled."""

    law: Array
    numbers: Array
    speed: float


def discrepancy(problem: JointProblem, fitted: Fitted) -> Discrepancy | None:
    """Return what the laws of a fitted model may be wrong by, None where it has no law."""
    effects = [e for e in problem.model.effects if e.basis is None]
    if not effects or fitted.failed:
        return None
    by_shot = [
        _of_shot(problem, item, fitted.theta, nuisance, effects)
        for item, nuisance in zip(problem.shots, fitted.nuisances, strict=True)
    ]
    columns: list[list[Array]] = [[] for _ in by_shot]
    speeds: list[list[Array]] = [[] for _ in by_shot]
    for one_effect in zip(*by_shot, strict=True):
        scale = _scale(problem.shots, one_effect)
        for row, one in enumerate(one_effect):
            columns[row] += [one.law, one.numbers * scale]
            shift = np.zeros(one.law.shape[1] + scale.size)
            shift[0] = one.speed
            speeds[row].append(shift)
    of_law_itself = (*(f"size {k}" for k in range(HIGHEST_ORDER + 1)), "delay")
    laws = [
        (e.id, column)
        for e in effects
        for column in (*of_law_itself, *(p.name for p in e.parameters))
    ]
    rows = [
        row
        for e in effects
        for row in (*(None for _ in of_law_itself), *problem.model.places[e.id])
    ]
    pairs = sorted({item.pair for item in problem.shots})
    first = [pairs.index(item.pair) * len(laws) for item in problem.shots]
    return Discrepancy(
        [of_law(*law, pair) for pair in pairs for law in laws],
        [np.column_stack(c) for c in columns],
        [np.concatenate(s) for s in speeds],
        [np.arange(at, at + len(laws), dtype=np.intp) for at in first],
        _sharing(problem, pairs, rows),
    )


def _sharing(
    problem: JointProblem, pairs: Sequence[str], rows: Sequence[int | None]
) -> dict[int, list[int]]:
    """Return for the coefficient of an effect's number those of all pairs that have this number.

    ``rows`` is the local parameter of each coefficient of a pair, None where it is no number's.
    """
    of_number: dict[ParameterName | int, list[int]] = {}
    items = {item.pair: item for item in problem.shots}
    for place, (pair, row) in enumerate(product(pairs, rows)):
        if row is None:
            continue
        # where each shot has its own number, nothing is left for its pair to be off by
        shared = row < len(problem.model.shared)
        name = problem.effect_key(row, items[pair]) if shared else None
        of_number.setdefault(place if name is None else name, []).append(place)
    return {place: sharing for sharing in of_number.values() for place in sharing}


def _of_shot(
    problem: JointProblem, item: FitShot, theta: Array, nuisance: Array, effects: Sequence[Effect]
) -> list[_OfEffect]:
    """Return the columns of every law in one shot."""
    problem.checkpoint()
    model = problem.model
    local = np.concatenate([problem.shared_local(item, theta)[0], nuisance])
    found, jacobian, _ = model.linearise(local, item.frame)
    steps = model.steps(local, item.frame)
    of_effects = []
    for effect in effects:
        # an effect's numbers and nothing of what they do
        kept = tuple(e.silent() if e is effect else e for e in model.effects)
        without = dataclasses.replace(model, effects=kept)
        added = found.signal - without.predict(local, item.frame, steps=steps).signal
        if not np.isfinite(added).all():  # without it the contact has no end: nothing to compare
            added = np.zeros_like(added)
        delay = np.gradient(added) * item.frame.sample_rate_hz * found.contact_time_s
        shift = model.speed_shift(local, item.frame) - without.speed_shift(local, item.frame)
        law = np.column_stack([_sizes(added), delay])
        of_effects.append(_OfEffect(law, jacobian[:, list(model.places[effect.id])], shift))
    return of_effects


def _sizes(added: Array) -> Array:
    """Return a signal times polynomials over its own course. Shape (n, orders)"""
    passed = np.cumsum(added**2)
    if not passed[-1] > 0.0:
        return np.zeros((added.size, HIGHEST_ORDER + 1))
    u = 2.0 * passed / passed[-1] - 1.0
    return np.asarray(legvander(u, HIGHEST_ORDER) * added[:, None])


def _scale(items: Sequence[FitShot], of_effect: Sequence[_OfEffect]) -> Array:
    """Return what makes the columns of an effect's numbers as large as its signal. Shape (p,)"""
    signal, numbers = 0.0, np.zeros(of_effect[0].numbers.shape[1])
    for item, one in zip(items, of_effect, strict=True):
        white = item.whiten(np.column_stack([one.law[:, :1], one.numbers]))
        squares = np.sum(white**2, axis=0)
        signal += float(squares[0])
        numbers += squares[1:]
    seen = numbers > 0.0
    return np.where(seen, np.sqrt(signal / np.where(seen, numbers, 1.0)), 0.0)
