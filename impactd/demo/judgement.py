"""Whether a verdict was right, said once the seal is open: also when it was not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from analysis.effects.library import library
from impactd.aliases import Json


@dataclass(frozen=True)
class Judgement:
    """A verdict compared with the truth.

    Attributes
    ----------
    word : str
        ``RIGHT``, ``PARTLY RIGHT``, ``NOT FOUND`` or ``WRONG``.
    """

    word: str
    sentence: str

    @property
    def right(self) -> bool:
        """Return whether nothing was wrong or missing."""
        return self.word == "RIGHT"


def judge(diagnosis: Json, effects: Sequence[Json]) -> Judgement:
    """Hold a verdict against what truly acted.

    Parameters
    ----------
    diagnosis : dict
        ``impactd-diagnosis/1``.
    effects : sequence of dict
        What the simulated rig hid: ``id``, ``slot``.

    Returns
    -------
    Judgement
        Strict: a right abstention is right, a missed effect is not.
    """
    verdict = diagnosis["verdict"]
    hidden = [str(effect["id"]) for effect in effects]
    if verdict == "not_identifiable":
        return Judgement("NOT FOUND", "the diagnosis made no statement.")
    if verdict == "adequate":
        return _nothing_found(hidden)
    if not hidden:
        return Judgement("WRONG", "nothing was hidden: this is a false alarm.")
    if verdict == "unknown":
        return _abstained(diagnosis, effects)
    return _named(diagnosis, hidden)


def truth_line(effect: Json) -> str:
    """Return one sealed effect in words.

    Parameters
    ----------
    effect : dict
        As the simulated rig sealed it.

    Returns
    -------
    str
        Id, slot, numbers, where it acts, whether the library has it.
    """
    numbers = ", ".join(f"{name} = {value:.4g}" for name, value in effect["parameters"].items())
    scope = effect.get("scope", {}).values()
    where = " and ".join(f"{_and([n] if isinstance(n, str) else n)} only" for n in scope)
    parts = [
        f"{effect['id']} (slot {effect['slot']})",
        numbers,
        f"acts on {where}" if where else "",
    ]
    if effect["id"] not in library():
        parts.append("the library does not have it")
    return "; ".join(part for part in parts if part)


def _nothing_found(hidden: list[str]) -> Judgement:
    if not hidden:
        return Judgement("RIGHT", "nothing was hidden, and nothing was claimed.")
    acts = "acts" if len(hidden) == 1 else "act"
    return Judgement(
        "NOT FOUND",
        f"{_and(hidden)} {acts}, but its signal is below the noise of these drops.",
    )


def _abstained(diagnosis: Json, effects: Sequence[Json]) -> Judgement:
    """Judge an "unknown"."""
    inside = [str(e["id"]) for e in effects if e["id"] in library()]
    slots = sorted({str(effect["slot"]) for effect in effects})
    said = str(diagnosis["slot"])
    place = (
        f"the slot, {said}, is right"
        if said in slots
        else f"the slot is not: {said} was said, and it is {_and(slots)}"
    )
    if inside:
        return Judgement(
            "NOT FOUND",
            f"{_and(inside)} is in the library and was not named; nothing false was named either. "
            f"{place[0].upper()}{place[1:]}.",
        )
    word = "RIGHT" if said in slots else "PARTLY RIGHT"
    return Judgement(
        word, f'no effect of the library acts, and "unknown" is the right answer; {place}.'
    )


def _named(diagnosis: Json, hidden: list[str]) -> Judgement:
    """Judge a verdict that names something."""
    named = [str(effect["id"]) for effect in diagnosis["effects"]]
    confusable = {
        str(name) for effect in diagnosis["effects"] for name in effect["confusable_with"]
    }
    family = diagnosis["verdict"] == "family"
    outside = [name for name in hidden if name not in library()]
    found = [name for name in hidden if name in named]
    relatives = [name for name in hidden if name in confusable and name not in named]
    false = [name for name in named if name not in hidden]
    if not false and set(found) == set(hidden):
        if diagnosis["verdict"] == "partial":
            return Judgement(
                "PARTLY RIGHT", f"{_and(hidden)} is right, but the model leaves structure."
            )
        note = ", which could not be distinguished from others" if family else ""
        return Judgement("RIGHT", f"{_and(hidden)} is right{note}.")
    if family and set(found) | set(relatives) == set(hidden):
        return Judgement(
            "RIGHT",
            f"{_and(hidden)} is in the family that these drops cannot distinguish, but another "
            "member is listed first.",
        )
    if found:
        missing = [name for name in hidden if name not in found]
        parts = [f"{_and(missing)} acts too and was not named"] if missing else []
        parts += [f"{_and(false)} was named and does not act"] if false else []
        return Judgement("PARTLY RIGHT", f"{_and(found)} acts; {'; '.join(parts)}.")
    if outside and diagnosis["verdict"] == "partial":
        return Judgement(
            "PARTLY RIGHT",
            f"{_and(hidden)} acts, which is not in the library; {_and(named)} was named as a part "
            "of it, and the verdict says that structure remains.",
        )
    return Judgement("WRONG", f"{_and(named)} was named, and {_and(hidden)} acts.")


def _and(names: Sequence[str]) -> str:
    return " and ".join(names)
