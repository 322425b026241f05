"""Limits given on the command line, and the decision about a modulus."""

# ruff: noqa: PLC0415 - imported when a command runs: `--help` must not wait for numpy

from __future__ import annotations

from dataclasses import dataclass

from impactd.aliases import Json
from impactd.console.failure import Failure
from impactd.console.options import Modulus, Rule

MEASURANDS = {
    Modulus.YOUNG: "youngs_modulus_Pa",
    Modulus.PLANE_STRAIN: "plane_strain_modulus_Pa",
}


@dataclass(frozen=True)
class Asked:
    """What was asked of one material.

    Attributes
    ----------
    lower_pa, upper_pa : float or None
        Limits; none of them means that nothing is decided. [Pa]
    rule : Rule
        How it is decided.
    guard : float
        Guard band over the expanded uncertainty.
    specimen : str or None
        Whose; None where only one material was to be found.
    """

    lower_pa: float | None = None
    upper_pa: float | None = None
    rule: Rule = Rule.BOTH
    guard: float = 1.0
    of: Modulus = Modulus.YOUNG
    specimen: str | None = None

    @property
    def limited(self) -> bool:
        """Tell whether there is a limit."""
        return self.lower_pa is not None or self.upper_pa is not None

    def query(self) -> Json:
        """Return the same as parameters of ``GET /v1/moduli/budget``."""
        if not self.limited:
            return {}
        return {
            "lower_Pa": self.lower_pa,
            "upper_Pa": self.upper_pa,
            "rule": self.rule.value,
            "guard_factor": self.guard,
            "modulus": MEASURANDS[self.of],
        }

    def write_into(self, document: Json, sought: list[str]) -> None:
        """Write the decision into a budget document.

        Parameters
        ----------
        document : dict
            ``impactd-budget/1``; changed in place.
        sought : list of str
            Materials whose modulus was to be found.

        Raises
        ------
        Failure
            If the limits mean nothing, or nobody can tell which material they are for.
        """
        if not self.limited:
            return
        from analysis.conformity import Limits, decide
        from analysis.errors import AnalysisError

        if self.specimen is None and len(sought) != 1:
            raise Failure(
                f"A limit is for one material; choose it with --specimen: {', '.join(sought)}."
            )
        name = self.specimen or sought[0]
        if document["status"].get(name) == "withheld":
            raise Failure(f"The modulus of {name} is withheld, so nothing can be decided.")
        try:
            limits = Limits(self.lower_pa, self.upper_pa, self.rule.value, self.guard)
            decide(document, name, MEASURANDS[self.of], limits)
        except AnalysisError as error:
            raise Failure(str(error)) from None
