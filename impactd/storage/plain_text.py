"""The characters that a name or a note may hold.

Control characters move a terminal's cursor and end log lines; bidi controls and other format
characters let a text look like another one. Refused are the Unicode categories Cc, Cf, Cs, Zl and
Zp. Two format characters belong to words: without the zero-width non-joiner and joiner, Persian
and many Indic words are misspelt. They may stand between two visible characters.
"""

from __future__ import annotations

import unicodedata

_REFUSED = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
_JOINERS = frozenset("\u200c\u200d")


def find_forbidden(text: str) -> str | None:
    """Return the first character that a text must not hold, ``None`` when there is none.

    E.g. ``"U+202E RIGHT-TO-LEFT OVERRIDE as character 3"``.
    """
    for position, letter in enumerate(text):
        if unicodedata.category(letter) not in _REFUSED:
            continue
        around = (text[position - 1 : position], text[position + 1 : position + 2])
        if letter in _JOINERS and all(map(_is_visible, around)):
            continue
        name = unicodedata.name(letter, "control character")
        return f"U+{ord(letter):04X} {name} as character {position + 1}"
    return None


def _is_visible(letter: str) -> bool:
    return bool(letter) and unicodedata.category(letter)[0] not in "CZ"
