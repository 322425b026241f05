r"""Units as the D-SI writes them (``\newton\volt\tothe{-1}``), and what they are in SI base units.

Source: the D-SI's reports (SmartCom, doi 10.5281/zenodo.3522631), which take their words from the
LaTeX package siunitx: a prefix, a unit, ``\tothe{n}`` behind what it belongs to, and ``\per``
before one unit to be divided by.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass

from impactd.certificates.errors import CertificateError

_PREFIXES = {
    "deca": 1e1, "hecto": 1e2, "kilo": 1e3, "mega": 1e6, "giga": 1e9, "tera": 1e12,
    "deci": 1e-1, "centi": 1e-2, "milli": 1e-3, "micro": 1e-6, "nano": 1e-9, "pico": 1e-12,
    "femto": 1e-15,
}  # fmt: skip
_UNITS: dict[str, tuple[float, dict[str, int]]] = {
    "one": (1.0, {}),
    "percent": (1e-2, {}),
    "metre": (1.0, {"m": 1}),
    "kilogram": (1.0, {"kg": 1}),
    "gram": (1e-3, {"kg": 1}),
    "tonne": (1e3, {"kg": 1}),
    "second": (1.0, {"s": 1}),
    "minute": (60.0, {"s": 1}),
    "hour": (3600.0, {"s": 1}),
    "ampere": (1.0, {"A": 1}),
    "kelvin": (1.0, {"K": 1}),
    "hertz": (1.0, {"s": -1}),
    "newton": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "pascal": (1.0, {"kg": 1, "m": -1, "s": -2}),
    "joule": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "watt": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "coulomb": (1.0, {"s": 1, "A": 1}),
    "volt": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "ohm": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
}
"""Factor to SI base units, and their powers. `degreecelsius` is no multiple and stays out."""
_WORD = re.compile(r"\\([a-z]+)(?:\{([^{}]*)\})?")


@dataclass(frozen=True)
class Unit:
    """A unit as a multiple of SI base units.

    Attributes
    ----------
    factor : float
        What a value is multiplied by.
    powers : tuple of (str, int)
        Base units and their powers other than 0, sorted.
    """

    factor: float
    powers: tuple[tuple[str, int], ...]

    def inverse(self) -> Unit:
        """Return one over this unit."""
        return Unit(1 / self.factor, tuple((base, -power) for base, power in self.powers))


def parse_unit(text: str) -> Unit:
    r"""Return what a D-SI unit is in SI base units.

    Parameters
    ----------
    text : str
        For example ``\milli\volt\newton\tothe{-1}``.

    Raises
    ------
    CertificateError
        If a word of it is not known here.
    """
    stripped = text.strip()
    words = [(match[1], match[2]) for match in _WORD.finditer(stripped)]
    if not words or _WORD.sub("", stripped):
        raise _unknown(text, stripped)
    factor, powers = 1.0, Counter[str]()
    at = 0
    while at < len(words):
        divided = words[at] == ("per", None)
        at += divided
        scale = 1.0
        if at < len(words) and words[at][0] in _PREFIXES and words[at][1] is None:
            scale = _PREFIXES[words[at][0]]
            at += 1
        if at == len(words) or words[at][0] not in _UNITS or words[at][1] is not None:
            raise _unknown(text, words[at][0] if at < len(words) else "its end")
        own, bases = _UNITS[words[at][0]]
        at += 1
        power = 1
        if at < len(words) and words[at][0] == "tothe":
            if re.fullmatch(r"[-+]?[1-9]", words[at][1] or "") is None:
                raise _unknown(text, rf"\tothe{{{words[at][1]}}}")
            power = int(words[at][1])
            at += 1
        power = -power if divided else power
        factor *= (scale * own) ** power
        for base, one in bases.items():
            powers[base] += one * power
    return Unit(factor, tuple(sorted((base, n) for base, n in powers.items() if n)))


def _unknown(text: str, word: str) -> CertificateError:
    return CertificateError(
        f"The unit {text!r} cannot be read at {word!r}.",
        r"The D-SI writes units as \milli\volt\newton\tothe{-1}; ask the laboratory for such a "
        "certificate.",
    )
