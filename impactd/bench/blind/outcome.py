"""What became of one trial: every trial is exactly one of `OUTCOMES`."""

from __future__ import annotations

from impactd.bench.blind.trial import Trial
from impactd.bench.blind.visibility import VISIBLE

OUTCOMES = ("right", "family", "half", "wrong", "unknown", "missed", "adequate", "failed")
"""All named; named but for a confusion set that holds the truth; some named and nothing false; a
name that did not act; abstained; nothing seen; rightly nothing seen; the diagnosis raised."""

ABSTAINED = ("unknown", "not_identifiable")


def outcome(trial: Trial) -> str:
    """Return what became of a trial.

    Parameters
    ----------
    trial : Trial
        Any.

    Returns
    -------
    str
        One of `OUTCOMES`. A first name that did not act is taken back where its confusion set
        holds the truth: the diagnosis said that it could be either.
    """
    if trial.verdict == "failed":
        return "failed"
    if trial.verdict == "adequate":
        return "missed" if trial.truth else "adequate"
    if trial.verdict in ABSTAINED:
        return "unknown"
    strangers = [name for name in trial.named if name not in trial.truth]
    missing = [name for name in trial.truth if name not in trial.named]
    shared = [name for name in missing if name in trial.confusable]
    if strangers and shared and trial.named[0] == strangers[0]:
        strangers = strangers[1:]
        missing.remove(shared[0])
    if strangers:
        return "wrong"
    if missing:
        return "half"
    return "family" if trial.confusable else "right"


def names_all(trial: Trial) -> bool:
    """Return whether all that acted was named, by itself or in a confusion set.

    Parameters
    ----------
    trial : Trial
        One in which something acted.

    Returns
    -------
    bool
        Also where something else was named as well; `outcome` is then ``wrong``.
    """
    return bool(trial.named) and set(trial.truth) <= {*trial.named, *trial.confusable}


def grouping_of(trial: Trial) -> str:
    """Return on how many materials of a kind the first effect of a trial acts.

    Parameters
    ----------
    trial : Trial
        One in which something acted.

    Returns
    -------
    str
        ``one``, ``some`` or ``all``.
    """
    names = list(trial.effects[0].get("scope", {}).values())
    return "all" if not names else "one" if isinstance(names[0], str) else "some"


def groups_right(trial: Trial) -> bool:
    """Return whether what acted was named with the very materials that it acts on.

    Parameters
    ----------
    trial : Trial
        One with ``acts_on``, in which something acted.

    Returns
    -------
    bool
        A name that was confusable, or beside a false one, counts as long as it was given itself.
    """
    said = dict(zip(trial.named, trial.acts_on or [], strict=True))
    return all(said.get(str(e["id"])) == e.get("scope", {}) for e in trial.effects)


def is_detectable(trial: Trial) -> bool:
    """Return whether every effect of a trial would by itself leave a residual of 20 in norm.

    Parameters
    ----------
    trial : Trial
        Any; where nothing acts, nothing is detectable.

    Returns
    -------
    bool
        By the simulator's account, which knows nothing of the diagnosis.
    """
    alone = trial.visible_each or ([] if trial.visible is None else [trial.visible])
    return bool(alone) and min(alone) >= VISIBLE
