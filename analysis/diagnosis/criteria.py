"""The thresholds that decide a diagnosis, each with its origin.

A threshold is compared with a statistic of the data, and what is said or done next depends on it.
What shapes a search or a basis is none: numbers of starts, shots and iterations, grids, steps of
derivatives, prior widths and the weights of the slot score stand where they are used.

The same question has the same threshold wherever it is asked: a share of a whole is *nothing*,
*little*, *half* or *nearly all*, and no place has a share of its own. The scale is coarse on
purpose. What is decided by it must come out well although none of its steps was fitted to anything.

"Squares" are whitened squares, twice a log-likelihood: a difference of 2 ln r is a likelihood ratio
of r. Every docstring ends with the origin of its value:

================  ==================================================================================
Rate              a probability that means itself; how large it may be is a choice
Derived           follows from what is said after it
Measured          set above what was seen in campaigns, as is said after it
Scale             a step of a coarse scale, the same for every question of its kind
Chosen by trial   simulated campaigns came out well with it; there is no derivation
================  ==================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Criteria:
    """All thresholds: of chance, of squares, of shares, of ratios, and least numbers."""

    false_alarm_rate: float = 2e-3
    """Chance, all families together, of calling a clean campaign discrepant. Rate."""
    single_question_rate: float = 1e-6
    """Chance below which a single question has an answer: a line in the noise's spectrum, a trend
    of the residual, a shot's number that follows the material or the order. Rate."""
    deviations: float = 6.0
    """Standard deviations of what no chance brings, in noise, in a sum of squares, or between two
    rivals after the next drops. Derived: the normal tail is 1e-9."""
    excess_deviations: float = 4.0
    """The same of what is no sign of more yet. Derived: the normal tail is 3e-5."""

    least_lead: float = 15.0
    """Twice the rise of ln Z below which an effect, a form or a grouping is not taken, and two
    names are not told apart. Derived: 2 ln(100 x 19): one of a hundred that might be meant is right
    in 19 of 20 cases."""
    price_of_number: float = 12.0
    """Squares of a number whose posterior nobody has computed yet. Derived: BIC's ln n for n =
    163 000 samples, the same for campaigns of every size."""
    price_of_coefficient: float = 2.0
    """Squares of a discrepancy's coefficient, to first order. Derived: Akaike's price."""
    clear_lead: float = 100.0
    """Squares that neither an unfinished fit nor the rest of a residual makes up. Scale."""
    certain_lead: float = 1e4
    """Squares by which one material's effect is told from all that act on every shot. Scale."""
    no_difference: float = 1.0
    """Squares that mean nothing. Derived: the mean of chi-square with one degree of freedom."""
    curved_squares: float = 300.0
    """Of nine shots beyond the noise, by the mean of all, from which a slope is only a promise.
    Chosen by trial."""
    far_squares_per_sample: float = 1.5
    """From which the present fit is no place to begin. Chosen by trial."""

    nothing: float = 0.01
    """A share of a whole that is as good as none: what may remain beside names that stand although
    structure remains, or outside of one material's shots. Scale; a law that is taken as written is
    wrong by about as much, see `analysis.diagnosis.basis.form_error`."""
    little: float = 0.1
    """A share of a whole that decides nothing. Scale; of the squares above the noise's own 0.0144
    was the most in 910 clean campaigns."""
    half: float = 0.5
    """The larger part of a whole. Scale."""
    nearly_all: float = 0.9
    """What leaves little. Scale."""
    named_beside: float = 1.0 / 3.0
    """Of the likeliest slot's probability, from which another is named beside it. Derived: of two
    slots at these odds the second is the true one in a quarter of cases."""

    noticeable: float = 1.2
    """A ratio that is worth a sentence. Scale; no verdict depends on it."""
    twice: float = 2.0
    """A ratio that is much. Scale."""
    far_larger: float = 30.0
    """A ratio that is another order of magnitude. Scale; a 1/f slope makes a line 5 times as strong
    as those beside it at most."""
    heldout_change: float = 1e-3
    """Share by which an error on held-out shots must differ to mean anything. Chosen by trial."""
    least_deviation_in_steps: float = 0.75
    """Standard deviation over the converter's step. Derived: rounding then lowers the excess
    kurtosis, by at most 0.022, and makes no spikes; from 0.6 steps downwards it can raise it."""
    uncertain_u: float = 0.3
    """Standard uncertainty of a logarithm or an exponent that is hardly known. Scale."""

    least_shots: int = 6
    """For a trend, a dependence, or a phase that shots have in common. Scale; chance leaves 0.17 of
    a power in common to so many."""
    least_quiet_samples: int = 64
    """Of a record before the trigger, to be looked at. Chosen by trial."""
    least_pooled_samples: int = 2000
    """Of all records, for a kurtosis to be told. Derived: its standard error is then 0.11."""


CRITERIA = Criteria()
"""The one set that every module of this folder decides by."""
