"""What a fit found, as a value: numbers with uncertainty, and an outcome that says what to do."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from analysis.aliases import Json
from analysis.budget import budgets_json
from analysis.fit import estimates, statements
from analysis.fit.conflicts import Conflict, conflicts, fit_without
from analysis.fit.joint import Fitted
from analysis.fit.measurand import as_quantity, measurand, young_from_plane_strain
from analysis.fit.physical_range import OutOfRange, advice, out_of_range
from analysis.fit.problem import FitShot, JointProblem
from analysis.fit.shot_fit import MISFIT_ABOVE, ShotFit, collect
from analysis.fit.statements import WITHHOLD_ABOVE
from analysis.identifiability import Identifiability, identifiability
from analysis.model import solver
from analysis.moduli_html import moduli_html
from analysis.undetermined import Undetermined, undetermined

__all__ = [
    "MISFIT_ABOVE",
    "WITHHOLD_ABOVE",
    "FitResult",
    "Outcome",
    "ShotFit",
    "as_quantity",
    "collect",
    "measurand",
    "young_from_plane_strain",
]

FORMAT = "impactd-fit/1"


@dataclass(frozen=True)
class Outcome:
    """How a fit ended, in words."""

    status: str
    """``converged``, ``not_converged``, ``out_of_range`` (a number that nothing can have) or
    ``not_evaluable``."""
    message: str
    """What happened and, unless all is well, what to do."""


def outcome_of(problem: JointProblem, fitted: Fitted) -> Outcome:
    """Return how a fit ended, in words.

    A number out of its physical range counts before a fit that has not converged.
    """
    if fitted.failed:
        return Outcome(
            "not_evaluable",
            "The model cannot be evaluated at any start near these records; check masses, radii, "
            "heights and the sensor's values.",
        )
    outside = out_of_range(problem, fitted)
    if outside:
        return Outcome("out_of_range", advice(outside))
    if not fitted.converged:
        return Outcome(
            "not_converged",
            f"The fit still moved after {fitted.iterations} steps; look at the residual, and check "
            "heights, masses and the sensor's values before trusting any number.",
        )
    return Outcome("converged", "The fit converged.")


@dataclass(frozen=True)
class FitResult:
    """A joint fit of a campaign.

    Attributes
    ----------
    fitted : Fitted
        End point; its covariance is already widened by ``misfit``.
    shots : tuple of ShotFit
        In order of time.
    misfit : float
        Variance factor by which covariances were widened because the residual exceeds the noise;
        1 where it does not.
    heldout_rms : float or None
        Residual of shots that the shared parameters had not seen. [unit of the signal]
    statements_asked : bool
        False where there was no time for the fit without contradicted statements.
    lacks_effect : bool
        True where an effect explains what this model leaves: then no statement does, and none is
        left out for a check.
    """

    model: str
    outcome: Outcome
    problem: JointProblem
    fitted: Fitted
    shots: tuple[ShotFit, ...]
    misfit: float
    heldout_rms: float | None
    statements_asked: bool = True
    lacks_effect: bool = False

    # -- quality ---------------------------------------------------------------------------------
    @property
    def degrees_of_freedom(self) -> int:
        """Return what noise leaves of squares, one a sample, less fitted parameters."""
        used = sum(s.item.expected_squares - 4 for s in self.shots)
        # a coarse record may hold next to nothing
        return max(round(used) - len(self.problem.names) + len(self.problem.inputs), 1)

    @property
    def chi2_per_dof(self) -> float:
        """Return the whitened squares of all samples per degree of freedom."""
        return sum(s.chi2 for s in self.shots) / self.degrees_of_freedom

    @property
    def rms(self) -> float:
        """Return the pooled residual. [unit of the signal]"""
        squares = sum(float(np.sum(s.residual**2)) for s in self.shots)
        return math.sqrt(squares / sum(s.item.frame.samples for s in self.shots))

    @property
    def noise_rms(self) -> float:
        """Return the pooled noise before the trigger. [unit of the signal]"""
        return math.sqrt(float(np.mean([s.item.noise.rms**2 for s in self.shots])))

    @property
    def r2(self) -> float:
        """Return 1 - SS_res / SS_tot pooled over the fit windows."""
        residual = sum(float(np.sum(s.residual**2)) for s in self.shots)
        total = 0.0
        for s in self.shots:
            y = s.item.window.signal
            total += float(np.sum((y - y.mean()) ** 2))
        return 1 - residual / total

    @property
    def nrmse(self) -> float:
        """Return the median over shots of rms residual over peak."""
        return float(np.median([s.rms / s.item.window.peak for s in self.shots]))

    # -- parameters ------------------------------------------------------------------------------
    def sensor_logs(self) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return ln(M, k, mu, c) and covariance, None unless all four are parameters."""
        return estimates.sensor_logs(self.problem, self.fitted)

    def pair_modulus(self, item: FitShot) -> tuple[float, float, NDArray[np.float64]] | None:
        """Return ln E*, its standard uncertainty and its gradient by the globals."""
        return estimates.pair_modulus(self.problem, self.fitted, item)

    def calibration_part(self, item: FitShot) -> tuple[float, NDArray[np.float64]]:
        """Return the part of u(ln E*) from the cell's stated values, and the sensitivity."""
        return estimates.calibration_part(self.problem, self.fitted, item)

    def moduli(self) -> Json:
        """Return ``moduli`` of ``impactd-diagnosis/1``; nothing where the fit has no solution.

        Where statements contradict the shots, every other modulus also says what it is without
        them, and whether it rests on them. Where nothing else is wrong, one that rests on them is
        withheld: as stated it is known to be off, and without them it is only in
        ``without_conflicts``, because the culprit may be another one of them.
        """
        if self._void:
            return {}
        found = statements.moduli_json(self.problem, self.fitted)
        for one in self.undetermined:
            found[one.key] = statements.withheld(one.side, one.sentence)
        if self.out_of_range:
            statements.withhold_fitted(found, "; ".join(o.sentence for o in self.out_of_range))
        if self.conflicts and not self.statements_asked:
            statements.withhold_fitted(
                found,
                "nobody asked whether it rests on "
                + ", ".join(c.path for c in self.conflicts)
                + ", which the shots contradict",
            )
        if self.without_conflicts is not None:
            statements.add_without_conflicts(found, self.without_conflicts.moduli())
            if self.explained_by_a_statement:
                statements.withhold_resting(found, [c.path for c in self.conflicts])
        return found

    @cached_property
    def out_of_range(self) -> list[OutOfRange]:
        """Return the numbers that nothing can have; with any, no modulus is stated."""
        return out_of_range(self.problem, self.fitted)

    @cached_property
    def undetermined(self) -> list[Undetermined]:
        """Return the moduli that were sought and that no quieter record would tell either."""
        return undetermined(self.problem, self.fitted)

    @cached_property
    def conflicts(self) -> list[Conflict]:
        """Return the statements that contradict the shots, worst first."""
        return [] if self._void else conflicts(self.problem, self.fitted)

    @cached_property
    def without_conflicts(self) -> FitResult | None:
        """Return the fit in which those statements say next to nothing; None where there is none.

        None too where the model is far from the shots without them as well.
        """
        if self.lacks_effect or not (self.conflicts and self.statements_asked):
            return None
        clear = fit_without(self.problem, self.fitted, self.conflicts, widened=self.misfit)
        if clear is None:
            return None
        problem, fitted = clear
        shots = collect(problem, fitted, scale=self.misfit)
        found = dataclasses.replace(self, problem=problem, fitted=fitted, shots=shots)
        # what was left out does not contradict any more; asking again would never end
        found.__dict__["conflicts"] = []
        return found

    @property
    def explained_by_a_statement(self) -> bool:
        """Whether only noise remains once the contradicted statements are left out."""
        clear = self.without_conflicts
        if clear is None:
            return False
        # chi2 per degree of freedom of noise has a variance of 2 / dof; chance alone goes beyond
        # four standard deviations once in 30 000
        return clear.chi2_per_dof <= 1.0 + 4.0 * math.sqrt(2.0 / clear.degrees_of_freedom)

    def contradictions(self) -> list[str]:
        """Return who contradicts whom in words, and which moduli do not rest on it."""
        said = [c.sentence for c in self.conflicts]
        if not said:
            return []
        them = "it" if len(said) == 1 else "them"
        if self.explained_by_a_statement:
            said.append(f"Without {them} the model leaves only noise.")
        elif self.misfit > 1:
            # data snooping takes the model for right: the list is what a missing effect bends
            others = ", ".join(c.path for c in self.conflicts[1:])
            said[1:] = [f"The shots also contradict {others}."] if others else []
            said.append(
                f"Without {them} the model leaves more than noise too: it misses something else, "
                "which may be the reason. A diagnosis may find it."
            )
        return said + statements.rests(self.moduli())

    def budget(self) -> Json | None:
        """Return ``impactd-budget/1`` of every modulus; None where none is stated."""
        if self._void or self.out_of_range:
            return None
        return budgets_json(self.problem, self.fitted, self.degrees_of_freedom)

    def pairs(self) -> Json:
        """Return each pair's reduced modulus, or its stiffness in reduced units."""
        return {} if self._void else statements.pairs_json(self.problem, self.fitted)

    def parameters(self) -> Json:
        """Return what was fitted, identifiable combinations first, with units."""
        return {} if self._void else statements.parameters_json(self.problem, self.fitted)

    def identifiability(self, profiled: Sequence[str] = ()) -> Identifiability:
        """Return which numbers come from the shots; a profile for each global named."""
        return identifiability(self.problem, self.fitted, self.shots, profiled=profiled)

    @property
    def _void(self) -> bool:
        return self.outcome.status == "not_evaluable"

    def to_json(self) -> Json:
        """Return the result as ``impactd-fit/1``; NaN and infinity never appear."""
        if self._void:
            return {
                "format": FORMAT,
                "model": self.model,
                "outcome": dataclasses.asdict(self.outcome),
                "parameters": {},
                "covariance": None,
                "moduli": {},
                "out_of_range": [],
                "conflicts": [],
                "budget": None,
                "pairs": {},
                "identifiability": None,
                "shots": [],
                "rejected": [dataclasses.asdict(r) for r in self.problem.rejected],
            }
        return {
            "format": FORMAT,
            "model": self.model,
            "outcome": dataclasses.asdict(self.outcome),
            "sentence": " ".join([self.outcome.message, *self.contradictions()]),
            "noise_rms_V": self.noise_rms,
            "noise": [_noise_json(s) for s in self._distinct_noise()],
            "rms_V": self.rms,
            "nrmse": self.nrmse,
            "r2": self.r2,
            "chi2_per_dof": self.chi2_per_dof,
            "degrees_of_freedom": self.degrees_of_freedom,
            "heldout_rms_V": self.heldout_rms,
            "uncertainty_widened_by": math.sqrt(self.misfit),
            "parameters": self.parameters(),
            "covariance": {
                "of": "natural logarithms of",
                "names": list(self.problem.names),
                "matrix": estimates.covariance_of_numbers(self.problem, self.fitted).tolist(),
            },
            "moduli": self.moduli(),
            "out_of_range": [one.to_json() for one in self.out_of_range],
            "conflicts": [c.to_json() for c in self.conflicts],
            "budget": self.budget(),
            "pairs": self.pairs(),
            "identifiability": self.identifiability().to_json(),
            "shots": [s.to_json() for s in self.shots],
            "rejected": [dataclasses.asdict(r) for r in self.problem.rejected],
            "assumptions": list(self.problem.assumptions),
            "flags": self.flags(),
        }

    def _repr_html_(self) -> str:
        return moduli_html(self.model, self.outcome.message, self.moduli())

    def flags(self) -> list[str]:
        """Return what a user must know before trusting the moduli."""
        found = [] if self.outcome.status == "converged" else [self.outcome.status]
        if self.misfit > 1:
            found.append("residual_above_noise")
        shifts = [m.get("shift_from_stated_in_u", 0.0) for m in self.moduli().values()]
        if any(abs(shift) > statements.CONTRADICTED_ABOVE for shift in shifts):
            found.append("references_contradicted")
        if self.problem.model.kind == solver.HSD:
            found.append("rigid_cell_model")
        if not self._void and self.identifiability().short:
            found.append("contact_law_not_identifiable")
        return found

    def _distinct_noise(self) -> list[FitShot]:
        seen: dict[tuple[str, float], FitShot] = {}
        for s in self.shots:
            seen.setdefault((s.item.shot.quantity, s.item.frame.sample_rate_hz), s.item)
        return list(seen.values())


def _noise_json(item: FitShot) -> Json:
    noise = item.noise
    return {
        "quantity": item.shot.quantity,
        "rms": noise.rms,
        "innovation_rms": noise.innovation_rms,
        "ar_coefficients": (noise.coefficients if noise.short is None else noise.short).tolist(),
        "one_over_f_below_Hz": noise.corner * item.frame.sample_rate_hz if noise.corner else None,
        "one_over_f_power": noise.slope if noise.corner else None,
        "converter_step": None if noise.coarse is None else noise.coarse.step,
        "samples": noise.samples,
        "source": noise.source,
    }
