"""The advice for a shot and its reasons, in the same words on the page and the command line.

::

    flags of a fit (`analysis`) ──> advice(shot, fits) ──> `use`, `check` or `repeat`, and reasons
                                                      └──> in_words(reason), for people
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from analysis.base_models import DEFAULT_BASE

if TYPE_CHECKING:
    from impactd.storage.fits import Fit
    from impactd.storage.shots import Shot

Advice = Literal["use", "check", "repeat"]

UNLIKE = "unlike_repetitions"
"""Reason whose words are the comparison's own where there are any."""
SENTENCES = {
    UNLIKE: "it is unlike its repetitions.",
    "clipped": (
        "the record is clipped: it reaches a limit of the converter or amplifier. Lower the "
        "height, or use a lighter sphere."
    ),
    "inverted_polarity": "the signal is upside down: check how the load cell is wired.",
    "residual_above_noise": (
        "the residual is larger than the noise. The uncertainty was widened; a diagnosis may find "
        "the cause."
    ),
    "restitution_above_one": "the sphere seems to come back faster than it fell: check the drop "
    "height.",
    "restitution_disagrees": (
        "the bounce and the trace give different rebounds: the sphere may have hit off-centre or "
        "touched the tube, or the drop height is wrong."
    ),
    "rebound_height_disagrees": "the rebound height that was entered does not agree with the "
    "bounce in the record.",
    "noise_not_measured": (
        "the record has too few quiet samples before the impact to measure the noise."
    ),
    "references_contradicted": "the fit moved the known materials far from their stated moduli.",
    "rigid_cell_model": "this model assumes a rigid load cell.",
    "contact_law_not_identifiable": (
        "the shot says too little about the contact law: the impact is short compared with "
        "the load cell's period."
    ),
    "not_converged": "the fit did not converge.",
    "out_of_range": (
        "the fit needs a number that is physically impossible, so no modulus is stated."
    ),
    "not_evaluable": "this model cannot be fitted to the shot.",
}
"""What each reason means for the person at the rig; a reason follows "because"."""


def in_words(reason: str) -> str:
    """Return a reason in words; an unknown one as it is."""
    return SENTENCES.get(reason, f"{reason.replace('_', ' ')}.")


def best_fit(fits: Sequence[Fit]) -> Fit | None:
    """Return the fit that counts for a shot: of the closed base, else of the paper's, else any."""
    for base in (DEFAULT_BASE, "kv"):
        for fit in fits:
            if fit.model.partition("+")[0] == base:
                return fit
    return fits[0] if fits else None


def advice(
    shot: Shot, fits: Sequence[Fit], *, unlike: bool = False
) -> tuple[Advice | None, list[str]]:
    """Return ``use``, ``check`` or ``repeat`` for a shot, and the reasons.

    ``None`` while there is no fit yet. The reasons are short words for programs, see `in_words`.
    ``unlike`` says whether the shot was unlike its repetitions right after the drop.
    """
    reasons = ["clipped"] if shot.clipped else []
    if unlike:
        reasons.append(UNLIKE)
    best = best_fit(fits)
    if best is None:
        return ("repeat" if shot.clipped else "check" if unlike else None), reasons
    reasons += [str(flag) for flag in best.result.get("flags") or [] if flag not in reasons]
    if shot.clipped:
        return "repeat", reasons
    outcome = best.result.get("outcome") or {}
    status = outcome.get("status") if isinstance(outcome, dict) else outcome
    if status not in (None, "converged") and status not in reasons:
        reasons.append(str(status))
    return ("check" if reasons else "use"), reasons
