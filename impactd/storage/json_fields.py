"""Reading JSON that somebody else wrote: every access validates and knows its path.

A wrong value is refused with file, JSON path and reason. Keys nobody knows are tolerated, because
people keep notes in such files (``source_file``), but a key that is nearly one we know is refused:
a misspelt ``drop_height_m`` must not silently become "height unknown".
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

from analysis.campaign import Quantity, Uncertainty
from impactd.storage.errors import CampaignError
from impactd.storage.plain_text import find_forbidden
from impactd.storage.ranges import (
    DEGREES_OF_FREEDOM,
    RELATIVE_RESOLUTION,
    Range,
    with_unit,
)
from impactd.storage.regular_file import read_regular_file

JSON_LIMIT_BYTES = 16 * 1024 * 1024
"""20 000 shots, each with every key the format knows (800 bytes). [B]"""

_UNITS = frozenset(
    [
        "m",
        "kg",
        "Pa",
        "Hz",
        "V",
        "s",
        "m_per_s2",
        "m_per_V",
        "N_per_m",
        "N_s_per_m",
        "N_per_V",
        "per_code",
        "index",
        "ratio",
        "modulus",
    ]
)


def read_json(path: Path) -> Any:
    """Return the JSON of a file; NaN, Infinity and repeated keys are refused.

    Raises CampaignError if it cannot be read or is no such JSON.
    """

    try:
        content = read_regular_file(path, JSON_LIMIT_BYTES)
    except FileNotFoundError as error:
        raise CampaignError(
            str(path), "$", "does not exist. Name a campaign.json, or the folder that holds one."
        ) from error
    except OSError as error:
        raise CampaignError(str(path), "$", f"cannot be read: {error.strerror}.") from error
    return parse_json(content, str(path))


def parse_json(content: bytes, file: str) -> Any:
    """Return the JSON of UTF-8 bytes; NaN, Infinity and repeated keys are refused.

    The mark that Windows editors put before the text may be there. Raises CampaignError if it is no
    such JSON.
    """

    def refuse_constant(text: str) -> NoReturn:
        """Refuse NaN and infinity, which JSON does not have."""
        raise CampaignError(file, "$", f"{text} is no JSON number.")

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        """Return an object; refuse one with a repeated key."""
        found: dict[str, Any] = {}
        for key, value in pairs:
            if key in found:
                raise CampaignError(file, "$", f"The key {key!r} stands twice in one object.")
            found[key] = value
        return found

    try:
        return json.loads(
            content.decode("utf-8-sig"), parse_constant=refuse_constant, object_pairs_hook=once
        )
    except UnicodeDecodeError as error:
        raise CampaignError(file, "$", "is not UTF-8 text.") from error
    except RecursionError as error:
        raise CampaignError(file, "$", "is nested too deeply.") from error
    except ValueError as error:  # also a number of more digits than Python reads
        raise CampaignError(file, "$", f"is not JSON: {error}.") from error


_OF_UNCERTAINTY = ("distribution", "degrees_of_freedom", "traceable_to")
DISTRIBUTIONS = ("normal", "rectangular")
_COUNT = Range(0, 2**53)
"""What a JSON number counts exactly."""


class Fields:
    """One JSON object that is being read.

    ``known`` are the keys this object may have; a near miss of one of them is refused. Raises
    CampaignError if it is no object or has a misspelt key.
    """

    def __init__(
        self, value: object, *, file: str, path: str = "$", known: Iterable[str] = ()
    ) -> None:
        self.file = file
        self.path = path
        if not isinstance(value, dict):
            self.refuse("", f"must be an object, not {_shown(value)}.")
        self._values: dict[str, Any] = value
        names = tuple(known)
        for key in value:
            near = _near_miss(key, names)
            if near is not None:
                self.refuse(key, f"is unknown; {near!r} was probably meant.")

    def refuse(self, key: str, reason: str) -> NoReturn:
        """Raise a CampaignError at a key of this object (empty = the object itself)."""
        raise CampaignError(self.file, self._path_of(key) if key else self.path, reason)

    def has(self, key: str) -> bool:
        """Return whether the key is there and not null."""
        return self._values.get(key) is not None

    def value(self, key: str) -> Any:
        """Return the value at a key, ``None`` when it is absent."""
        return self._values.get(key)

    def names(self) -> list[str]:
        """Return all keys in their order; each of them is a name."""
        for key in self._values:
            found = find_forbidden(key)
            if found is not None:
                self.refuse(key, f"holds {found}, which no name may hold.")
        return list(self._values)

    def number(self, key: str, within: Range) -> float | None:
        """Return a finite number within limits, ``None`` when it is absent or null."""
        value = self._values.get(key)
        if value is None:
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(key, f"must be a number, not {_shown(value)}.")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            self.refuse(key, "must be finite.")
        if not within.low <= number <= within.high:
            self.refuse(key, f"is {with_unit(number, within.unit)}; it must be {within}.")
        return number

    def whole(self, key: str) -> int | None:
        """Return a whole number >= 0, ``None`` when it is absent or null."""
        number = self.number(key, _COUNT)
        if number is None:
            return None
        if number != int(number):
            self.refuse(key, f"is {number:g}; it must be a whole number.")
        return int(number)

    def text(self, key: str) -> str | None:
        """Return a text that is not empty, ``None`` when it is absent or null."""
        value = self._values.get(key)
        if value is None:
            return None
        if not isinstance(value, str) or not value:
            self.refuse(key, f"must be a text that is not empty, not {_shown(value)}.")
        found = find_forbidden(value)
        if found is not None:
            self.refuse(key, f"holds {found}, which no name may hold.")
        return value

    def quantity(self, key: str, within: Range) -> Quantity | None:
        """Return ``{"value": ..., "u": ...}``, ``None`` when it is absent or null."""
        if not self.has(key):
            return None
        inner = self.child(key, known=("value", "u"))
        value = inner.number("value", within)
        u = inner.number("u", Range(0.0, max(abs(within.low), abs(within.high)), within.unit))
        if value is None:
            inner.refuse("value", "is missing.")
        if u is None:
            inner.refuse("u", "is missing: a quantity needs its standard uncertainty.")
        inner.refuse_unnoticeable("u", u, beside=value, unit=within.unit)
        return Quantity(value, u)

    def measured(self, key: str, within: Range) -> tuple[float | None, Uncertainty | None]:
        """Return a number, and its uncertainty where it is ``{"value": ..., "u": ...}``."""
        if not isinstance(self._values.get(key), dict):
            return self.number(key, within), None
        inner = self.child(key, known=("value", "u", *_OF_UNCERTAINTY))
        value = inner.number("value", within)
        if value is None:
            inner.refuse("value", "is missing.")
        if not inner.has("u"):
            inner.refuse("u", "is missing: a quantity needs its standard uncertainty.")
        # its logarithm is fitted, and has no Gaussian about a number that may as well be nothing
        return value, inner.uncertainty("u", Range(0.0, abs(value), within.unit), beside=value)

    def uncertainty(self, key: str, within: Range, *, beside: float = 1.0) -> Uncertainty | None:
        """Return a standard uncertainty with what is said of it, ``None`` when it is absent."""
        u = self.number(key, within)
        if u is None:
            return None
        self.refuse_unnoticeable(key, u, beside=beside, unit=within.unit)
        form = self.text("distribution") or DISTRIBUTIONS[0]
        if form not in DISTRIBUTIONS:
            told = " or ".join(DISTRIBUTIONS)
            self.refuse("distribution", f"is {form!r}; it must be {told}.")
        freedom = self.number("degrees_of_freedom", DEGREES_OF_FREEDOM)
        return Uncertainty(
            u, form, math.inf if freedom is None else freedom, self.text("traceable_to")
        )

    def refuse_unnoticeable(self, key: str, u: float, *, beside: float, unit: str) -> None:
        """Refuse an uncertainty that rounding hides beside its value, unless it is 0."""
        least = RELATIVE_RESOLUTION * (abs(beside) or 1.0)
        if 0.0 < u < least:
            limits = f"0 or at least {with_unit(least, unit)}"
            self.refuse(key, f"is {with_unit(u, unit)}; beside {beside:g} it must be {limits}.")

    def child(self, key: str, *, known: Iterable[str] = ()) -> Fields:
        """Return the object at a key; an absent one is empty."""
        value = self._values.get(key)
        path = self._path_of(key)
        return Fields({} if value is None else value, file=self.file, path=path, known=known)

    def array(self, key: str) -> list[Any]:
        """Return the array at a key; it must be there."""
        value = self._values.get(key)
        if not isinstance(value, list):
            self.refuse(key, f"must be an array, not {_shown(value)}.")
        return value

    def _path_of(self, key: str) -> str:
        # A key is what somebody else wrote: what a terminal would obey is shown as an escape.
        return f"{self.path}.{key if key.isprintable() else ascii(key)}"


def _shown(value: object) -> str:
    if value is None:
        return "absent"
    text = json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."


def _near_miss(key: str, known: tuple[str, ...]) -> str | None:
    if key in known:
        return None
    plain = {_plain(name): name for name in known}
    for name in known:
        if name.startswith(key + "_") and name[len(key) + 1 :] in _UNITS:
            return name
    close = difflib.get_close_matches(_plain(key), plain, n=1, cutoff=0.85)
    return plain[close[0]] if close else None


def _plain(key: str) -> str:
    return "".join(letter for letter in key.lower() if letter.isalnum())
