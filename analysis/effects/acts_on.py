"""The shots on which an effect acts: those of one material or of several of a kind."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

KINDS = ("surface", "sphere")


@dataclass(frozen=True)
class ActsOn:
    """Some materials of one kind; the effect is on their shots and on no others."""

    kind: str
    names: tuple[str, ...]
    """At least one, sorted."""

    def __post_init__(self) -> None:
        """Refuse what is no grouping; sort the names, so that equal groupings compare equal."""
        if self.kind not in KINDS or not self.names:
            raise ValueError(f"An effect acts on surfaces or spheres, not {self.kind} {self.names}")
        object.__setattr__(self, "names", tuple(sorted(set(self.names))))

    def includes(self, sphere: str | None, surface: str | None) -> bool:
        """Tell whether a shot of this sphere on this surface is among them."""
        return (surface if self.kind == "surface" else sphere) in self.names

    @property
    def label(self) -> str:
        """Return the bracketed suffix of the name of a number that they share."""
        return "+".join(self.names)

    def to_json(self) -> list[str]:
        """Return the kind, then the names."""
        return [self.kind, *self.names]

    @classmethod
    def from_json(cls, said: Sequence[str]) -> ActsOn:
        """Return what `to_json` wrote."""
        return cls(said[0], tuple(said[1:]))

    def words(self, present: Collection[str]) -> str:
        """Return it in words, ``present`` being all materials of the kind in the campaign.

        E.g. "on the surfaces ptfe and specimen", or, of many, "on all surfaces but ptfe".
        """
        others = sorted(set(present) - set(self.names))
        if others and len(others) < len(self.names) - 1:
            return f"on all {self.kind}s but {_listed(others)}"
        plural = "s" if len(self.names) > 1 else ""
        return f"on the {self.kind}{plural} {_listed(self.names)}"


def _listed(names: Sequence[str]) -> str:
    return " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
