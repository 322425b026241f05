"""The thresholds that decide a diagnosis, each with its origin.

A threshold is compared with a statistic of the data, and what is said or done next depends on it.
What shapes a search or a basis is none: numbers of starts, shots and iterations, grids, steps of
derivatives, prior widths and the weights of the slot score stand where they are used.

"Squares" are whitened squares, twice a log-likelihood: a difference of 2 ln r is a likelihood ratio
of r. Every docstring ends with the origin of its value:

================  ==================================================================================
Rate              a probability that means itself; how large it may be is a choice
Derived           follows from what is said after it
Measured          set above what was seen in campaigns, as is said after it
Chosen by trial   simulated campaigns came out well with it; there is no derivation
================  ==================================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Noise:
    """Is what comes before the trigger noise?"""

    spike_deviations: float = 6.0
    """Standard errors of the excess kurtosis that are no chance. Derived: the normal tail is 1e-9;
    the kurtosis' own law has a longer one."""
    tone_p_value: float = 1e-6
    """Chance of the highest of all lines of a spectrum, if there were only noise. Rate."""
    far_deviations: float = 5.0
    """From which a quiet sample is counted as far out. Derived: of Gaussian samples 6e-7 are."""
    least_quiet_samples: int = 200
    """Of a record, to be looked at. Chosen by trial."""
    least_pooled_samples: int = 2000
    """Of all records, for a kurtosis to be told. Chosen by trial."""
    least_deviation_in_steps: float = 0.75
    """Standard deviation over the converter's step. Derived: rounding then lowers the excess
    kurtosis, by at most 0.022, and makes no spikes; from 0.6 steps downwards it can raise it."""
    least_line_left: float = 0.75
    """Share of a line that must be left where drift has been taken off. Chosen by trial."""
    loud_tone_ratio: float = 30.0
    """Of a line to those beside it, that no 1/f slope makes. Measured: a slope makes 5 at most."""


@dataclass(frozen=True)
class Structure:
    """Is a residual more than noise?"""

    false_alarm_rate: float = 2e-3
    """Chance, all families together, of calling a clean campaign discrepant. Rate."""
    surplus_share: float = 0.1
    """Squares above the noise's own that mean nothing, over these. Measured: 0.0144 was the most in
    910 clean campaigns with noise of four colours."""
    surplus_deviations: float = 6.0
    """The same in standard deviations, for short campaigns. Derived: the normal tail is 1e-9."""
    excess_deviations: float = 4.0
    """Of a sum of squares, that are no sign of more. Derived: the normal tail is 3e-5."""
    odd_share: float = 0.1
    """Of a campaign's shots, that may be set aside as not belonging, and one always: what more
    have is a property of the rig. Rate."""
    odd_part: float = 0.5
    """Least part of its equal share, a k-th of all excess squares, that the worst of k odd shots
    has. Derived: the worst has a k-th or more, and a fit of all takes up at most half of it."""
    form_error: float = 0.01
    """Standard uncertainty of a law, as a share of its effect's own signal along each column of its
    discrepancy. Measured: a tape whose damping is a loss factor, fitted with one damping constant,
    is wrong by 1.0 % in rms and 2.4 % at most; another law of loss by 5.7 %, and is told."""


@dataclass(frozen=True)
class Search:
    """Where a fit begins, and which is carried on. None of these is a name's linearisation."""

    far_squares_per_sample: float = 1.5
    """From which the present fit is no place to begin. Chosen by trial."""
    curved_squares: float = 300.0
    """Of nine shots beyond the noise, by the mean of all, from which a slope is only a promise.
    Chosen by trial."""
    start_difference: float = 1.0
    """Squares by which a start must differ from the model without the effect. Chosen by trial."""
    known_prior_u: float = 0.3
    """Of a logarithm; a global with a narrower prior begins at its mean. Chosen by trial."""
    group_present_share: float = 0.3
    """Of a start, to first order, below which a group begins without it. Chosen by trial."""
    outlandish_ratio: float = 30.0
    """Of a first-order size to the usual one, from which it only says "large". Chosen by trial."""
    out_of_range_weight: float = 0.5
    """Of the score of a candidate outside its physical range, in early rounds. Chosen by trial."""
    contender_share: float = 0.4
    """Of the leader's score, below which a candidate is not carried on. Chosen by trial."""


@dataclass(frozen=True)
class Grouping:
    """Does a residual, or an effect, belong to one material? Squares are those beyond the noise."""

    outside_share: float = 0.02
    """Of the squares, that may lie outside the one material's shots. Chosen by trial."""
    unrelated_share: float = 1e-3
    """Below which what lies outside is another matter, noise or not. Chosen by trial."""
    certain_squares: float = 1e4
    """By which one material's effect is told from all that act on every shot. Chosen by trial."""
    simpler_share: float = 0.5
    """What may remain without a material, over its share of the shots. Chosen by trial."""


@dataclass(frozen=True)
class Comparison:
    """How much better must a model be? All in squares."""

    price_of_number: float = 12.0
    """Of a number whose posterior nobody has computed yet. Derived: BIC's ln n for n = 163 000
    samples, the same for campaigns of every size."""
    least_lead: float = 15.0
    """Twice the rise of ln Z below which an effect, a form or a grouping is not taken. Derived:
    2 ln(100 x 19): one of a hundred that might be meant is right in 19 of 20 cases."""
    mixed_left_share: float = 0.1
    """Of what the closed base leaves beyond the noise, that another choice of its laws of mechanics
    may leave to be taken. Measured: in 20 campaigns of closed rigs with an effect it left half of
    it or more; where the rig is such a choice and nothing else acts, next to nothing."""
    least_gain_per_shot: float = 10.0
    """Of a number that every shot has for itself. Chosen by trial; chance brings as much to one
    number in 640."""


@dataclass(frozen=True)
class FreeSignal:
    """Is a signal of free size and phase in every shot there whether a sphere falls or not?"""

    quiet_power_share: float = 0.2
    """Of a steady signal's power, to be found before the trigger. Chosen by trial."""
    quiet_power_deviations: float = 2.0
    """Standard deviations by which chance may lower that power. Derived: once in 44 times."""
    least_quiet_samples: int = 64
    """Of a record, for a free signal to be looked for in it. Chosen by trial."""
    common_phase_share: float = 0.4
    """Power that shots have in common, from which a phase is not free. Chosen by trial; chance
    leaves one over the number of shots, 0.17 of the fewest."""
    fewest_phases: int = 6
    """Shots of a group for that to be asked. Chosen by trial."""


@dataclass(frozen=True)
class Stepwise:
    """Which effects are tried on top of one another, and which names remain open?"""

    first_effect_share: float = 0.15
    """Of the best first effect's gain, below which another is no first. Chosen by trial."""
    third_effect_share: float = 0.1
    """Of the squares, that two effects may leave for a third to be tried. Chosen by trial."""
    confusable_within: float = 10.0
    """Effects that differ by less cannot be told apart. Chosen by trial: 148 to 1."""
    unfinished_within: float = 100.0
    """So close behind, a fit that has not ended is carried on. Chosen by trial."""
    unfinished_growth: float = 3.0
    """Times its last gain that a fit which has not ended may still gain. Chosen by trial."""
    partly_fitted_share: float = 0.5
    """Of the taken effect's gain, on a part of the shots, that asks for all. Chosen by trial."""


@dataclass(frozen=True)
class Partial:
    """Which names stand although structure remains? Shares are of what an effect explains."""

    one_left_share: float = 0.05
    """That may remain beside one effect. Chosen by trial."""
    several_left_share: float = 0.01
    """That may remain beside two or more, each. No more remains of a settled search, whose laws are
    then as they are written. Chosen by trial."""
    several_lead_ratio: float = 2.0
    """Of each one's gain to that of any other name, beside two or more. Chosen by trial."""
    ahead_squares: float = 100.0
    """By which an effect must be ahead of other names. Chosen by trial."""
    ahead_of_left_ratio: float = 2.0
    """The same over what remains. Chosen by trial."""
    akin_left_share: float = 0.005
    """That may still look like what was named, as no equation is exact. Chosen by trial."""


@dataclass(frozen=True)
class ModelFree:
    """Which effects do records show whatever the contact is?"""

    flat_width: float = 0.45
    """Of a top's width over that 20 times as far below it. Derived: twice a parabola's."""
    same_level: float = 0.1
    """Scatter of flat tops' heights over that of their flanks. Chosen by trial; 0.5 to 1.6 in five
    sets of others' recordings, and nothing but rounding where a top is cut."""
    unexplained_share: float = 0.1
    """Of the squares of an impulse's course, that its dying away may leave. Chosen by trial."""
    lasting_share: float = 0.1
    """Of an impulse, that may last. Chosen by trial."""


@dataclass(frozen=True)
class Discrepancy:
    """Which flexible discrepancies are learned, and which repairs? Errors are on held-out shots."""

    price_of_coefficient: float = 2.0
    """In squares, to first order. Derived: Akaike's price."""
    fold_own_weight: float = 0.02
    """Of a global's information, below which only the held-out shots know it. Chosen by trial."""
    learned_share: float = 0.15
    """Of the best first-order gain, from which a discrepancy is learned. Chosen by trial."""
    owned_lead_ratio: float = 1.02
    """By which a discrepancy of several groups must beat the rig's one. Chosen by trial."""
    speeds_alone_share: float = 0.9
    """Of the best gain, from which speeds alone explain the structure. Chosen by trial."""
    nothing_left_ratio: float = 1.002
    """Error over the noise at which nothing is left to repair. Chosen by trial."""
    much_left_ratio: float = 2.0
    """Error over the noise that is much. Chosen by trial."""
    further_ratio: float = 0.9995
    """Of the error, that one discrepancy more must leave at most. Chosen by trial."""


@dataclass(frozen=True)
class Slot:
    """Which part of the rig is named?"""

    named_beside_share: float = 1.0 / 3.0
    """Of the likeliest's probability, from which a slot is named beside it. Derived: of two slots
    at these odds the second is the true one in a quarter of cases."""
    explained_share: float = 0.3
    """Of the structure, below which even the best slot explains little. Chosen by trial."""
    formula_share: float = 0.9
    """Of a discrepancy's held-out gain, that a formula of few terms must have. Chosen by trial."""


@dataclass(frozen=True)
class NextDrop:
    """Which drop is proposed?"""

    distance: float = 6.0
    """Root of the squares by which drops must part two rivals. Derived: noise moves the difference
    of two costs by twice the distance, and 36 +- 12 leaves no doubt."""
    signal_share: float = 0.95
    """Of the converter's range, or of the smallest clipped peak. Chosen by trial."""


@dataclass(frozen=True)
class Words:
    """When is something worth a sentence? No verdict depends on these."""

    drift_ratio: float = 1.5
    """Rms of what is slow before the trigger over what noise leaves there. Chosen by trial."""
    nested_shortfall: float = 1.0
    """By so much priors and unfinished steps may leave a larger model behind. Chosen by trial."""
    residual_ratio: float = 1.2
    """Squares a sample in a phase of the record. Chosen by trial."""
    spectrum_ratio: float = 2.0
    """Power density of the residual over that of the noise. Chosen by trial."""
    lag_correlation: float = 0.25
    """Of residual and pulse. Chosen by trial."""
    speed_exponent_u: float = 0.3
    """Largest standard uncertainty of a power of the speed. Chosen by trial."""
    least_speed_spread: float = 0.05
    """Sum of squares of ln speed within pairs, for such a power. Chosen by trial."""
    least_shots: int = 6
    """For a power of the speed or a trend in time. Chosen by trial."""
    trend_p_value: float = 1e-3
    """Of the residual's size against the order of shots. Rate."""
    contrast_ratio: float = 1.5
    """Squares a sample of one material over those of another. Chosen by trial."""
    dependence_p_value: float = 1e-4
    """Of a shot's own number against material, order or height. Rate."""
    dependence_least_shots: int = 8
    """For such a dependence. Chosen by trial."""
    repeated_share: float = 0.5
    """Of the energy before touch-down, that is the same in every hit. Measured: of noise it is
    0 +- 0.3 in three hits of 7 samples, and less in more."""
    heldout_fold: float = 1.2
    """Fall of the held-out error, from which a discrepancy says what it looks like. Chosen by
    trial."""


@dataclass(frozen=True)
class Criteria:
    """All thresholds, by the question that they answer, in the order in which it is asked."""

    noise: Noise = field(default_factory=Noise)
    structure: Structure = field(default_factory=Structure)
    search: Search = field(default_factory=Search)
    grouping: Grouping = field(default_factory=Grouping)
    comparison: Comparison = field(default_factory=Comparison)
    free_signal: FreeSignal = field(default_factory=FreeSignal)
    stepwise: Stepwise = field(default_factory=Stepwise)
    partial: Partial = field(default_factory=Partial)
    model_free: ModelFree = field(default_factory=ModelFree)
    discrepancy: Discrepancy = field(default_factory=Discrepancy)
    slot: Slot = field(default_factory=Slot)
    next_drop: NextDrop = field(default_factory=NextDrop)
    words: Words = field(default_factory=Words)


CRITERIA = Criteria()
"""The one set that every module of this folder decides by."""
