"""The outcome of one trial: exactly one of `OUTCOMES`."""

from __future__ import annotations

from itertools import chain

from drivers.simulated.mistakes import MISTAKES, SINGLE_SHOT
from impactd.aliases import Json
from impactd.bench.blind.trial import Trial
from impactd.bench.blind.visibility import VISIBLE

OUTCOMES = ("right", "family", "half", "wrong", "unknown", "missed", "adequate", "failed")
"""All named; named but for a confusion set that holds the truth; some named and nothing false, or
all and good shots set aside with it; a name that did not act, or good shots set aside and nothing
right; abstained; nothing seen; rightly nothing seen; the diagnosis raised."""

ABSTAINED = ("unknown", "not_identifiable")
NAMED_AS = {"coupon_exchanged": "change_point", "gain_switched": "change_point"}
"""Ids that a diagnosis has for mistakes, where they are not the mistake's own."""
RECORD = tuple(dict.fromkeys(NAMED_AS.get(m, m) for m in MISTAKES if m not in SINGLE_SHOT))
"""Ids of a diagnosis for what people did wrong; one bad shot has none, it is set aside."""
SAME_HEIGHT = 0.01
"""Relative difference of two heights up to which they are one: drawn ones are tens of percent
apart, and a document may round."""
BESIDE = 1
"""Shots by which the beginning of a change may be off."""


def outcome(trial: Trial) -> str:
    """Return what became of a trial.

    Returns
    -------
    str
        One of `OUTCOMES`. A name that did not act is taken back where its own confusion set
        holds the truth: the diagnosis said that it could be either. Not so an effect of the
        library where people made a mistake.
    """
    if trial.verdict == "failed":
        return "failed"
    named, wanted = said_names(trial), wanted_names(trial)
    good_shots = [place for place in trial.set_aside if place not in wanted_shots(trial)]
    missing_shots = [place for place in wanted_shots(trial) if place not in trial.set_aside]
    if not named and not trial.set_aside:
        if trial.verdict == "adequate":
            return "missed" if trial.truth else "adequate"
        if trial.verdict in ABSTAINED or trial.mistake is not None:
            return "unknown"
    strangers = [name for name in named if name not in wanted]
    missing = [name for name in wanted if name not in named]
    for name in list(strangers):
        shared = [other for other in missing if other in could_also_be(trial, name)]
        if shared and (trial.mistake is None or name in RECORD):
            strangers.remove(name)
            missing.remove(shared[0])
    nothing_right = len(missing) == len(wanted) and len(missing_shots) == len(wanted_shots(trial))
    if strangers or (good_shots and nothing_right):
        return "wrong"
    if missing or missing_shots or good_shots:
        return "half"
    return "family" if any(trial.confusable) else "right"


def could_also_be(trial: Trial, name: str) -> list[str]:
    """Return the confusion set of a name that was given, empty without one."""
    return dict(zip(trial.named, trial.confusable, strict=False)).get(name, [])


def wanted_names(trial: Trial) -> list[str]:
    """Return the ids that a diagnosis should give.

    Returns
    -------
    list of str
        Empty where nothing acted, or one shot is bad.
    """
    if trial.mistake is None:
        return trial.truth
    return [] if trial.mistake["id"] in SINGLE_SHOT else [NAMED_AS.get(n, n) for n in trial.truth]


def wanted_shots(trial: Trial) -> list[int]:
    """Return the places of the shots that a diagnosis should set aside.

    Returns
    -------
    list of int
        The one bad shot, or none.
    """
    single = trial.mistake is not None and trial.mistake["id"] in SINGLE_SHOT
    return [int(trial.mistake["scope"]["shot"])] if trial.mistake and single else []


def said_names(trial: Trial) -> list[str]:
    """Return the ids that a diagnosis stands by.

    Returns
    -------
    list of str
        Where it abstained or found the rest adequate, those of mistakes alone.
    """
    if trial.verdict in ("adequate", *ABSTAINED):
        return [name for name in trial.named if name in RECORD]
    return trial.named


def claims_mistake(trial: Trial) -> bool:
    """Return whether a diagnosis says that people did something wrong.

    Returns
    -------
    bool
        Whether it was so or not.
    """
    return bool(trial.set_aside) or any(name in RECORD for name in trial.named)


def names_effect(trial: Trial) -> bool:
    """Return whether a diagnosis names an effect of the library.

    Returns
    -------
    bool
        Whether one acted or not.
    """
    return any(name not in RECORD for name in said_names(trial))


def names_all(trial: Trial) -> bool:
    """Return whether all that acted was named, by itself or in a confusion set.

    Parameters
    ----------
    trial : Trial
        One in which something acted.

    Returns
    -------
    bool
        Also where something else was named as well; `outcome` is then ``wrong``. Of one bad shot
        whether any shot was set aside; `groups_right` says which.
    """
    if wanted_shots(trial):
        return bool(trial.set_aside)
    return bool(trial.named) and set(wanted_names(trial)) <= {
        *trial.named,
        *chain(*trial.confusable),
    }


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
        Of a mistake whether the very shot was set aside, or whose number is wrong and from which
        shot on something changed.
    """
    if wanted_shots(trial):
        return trial.set_aside == wanted_shots(trial)
    pairs = list(zip(trial.named, trial.acts_on or [], strict=True))
    if trial.mistake is not None:
        said_of = [where for name, where in pairs if name in wanted_names(trial)]
        return bool(said_of) and all(_is_place_of(trial.mistake, where) for where in said_of)
    said = dict(pairs)
    return all(said.get(str(e["id"])) == e.get("scope", {}) for e in trial.effects)


def shown_rightly(trial: Trial) -> bool:
    """Return whether what is said of the materials is true of each effect, if not all of the truth.

    Parameters
    ----------
    trial : Trial
        As of `groups_right`, of which effects acted.

    Returns
    -------
    bool
        All that show it have it, and none that has it is left out of those that it may act on.
    """
    acts_on = dict(zip(trial.named, trial.acts_on or [], strict=True))
    seen_on = dict(zip(trial.named, trial.seen_on or trial.acts_on or [], strict=True))
    return all(
        _within(acts_on[name] | seen_on[name], scope) and _within(scope, acts_on[name])
        for name, scope in ((str(e["id"]), e.get("scope", {})) for e in trial.effects)
        if name in acts_on
    )


def _within(some: Json, others: Json) -> bool:
    """Return whether some materials are all among others; an empty one means everything."""
    if not some or not others:
        return not others
    return all(k in some and _names(some[k]) <= _names(others[k]) for k in others)


def _names(said: str | list[str]) -> set[str]:
    return {said} if isinstance(said, str) else set(said)


def _is_place_of(mistake: Json, said: Json) -> bool:
    """Return whether a scope, and the first shot of a change, are those of a mistake."""
    numbers, scope = mistake["numbers"], dict(said)
    first = scope.pop("first_shot", None)
    if "first_shot" in numbers:
        # between the last shot without the change and the first with it no shot could tell
        begins, ends = numbers["last_before"] + 1 - BESIDE, numbers["first_shot"] + BESIDE
        if first is None or not begins <= first <= ends:
            return False
    if "drop_height_m" in mistake["scope"]:
        height = scope.get("drop_height_m")
        right = mistake["scope"]["drop_height_m"]
        return height is not None and abs(height / right - 1.0) <= SAME_HEIGHT
    return bool(scope == mistake["scope"])


def is_detectable(trial: Trial) -> bool:
    """Return whether each effect or mistake would by itself leave a residual of 20 in norm.

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
