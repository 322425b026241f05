"""Which characters a name may hold."""

from __future__ import annotations

import pytest

from impactd.storage.plain_text import find_forbidden


@pytest.mark.parametrize(
    "text",
    ["ab", "Müller", "李", "نیم\u200cفاصله", "क्\u200dष", "polycarbonate 2 mm", "=1"],
)
def test_names_of_all_scripts_are_taken(text: str) -> None:
    """With the joiners that Persian and Indic words need."""
    assert find_forbidden(text) is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a\x00", "U+0000 control character as character 2"),
        ("a\x1b[2J", "U+001B"),
        ("\x85", "U+0085"),
        ("ab\u202egpj", "U+202E RIGHT-TO-LEFT OVERRIDE as character 3"),
        ("\u2067a", "U+2067 RIGHT-TO-LEFT ISOLATE"),
        ("a\u200fb", "U+200F RIGHT-TO-LEFT MARK"),
        ("a\u200bb", "U+200B ZERO WIDTH SPACE"),
        ("ab\u200d", "U+200D ZERO WIDTH JOINER"),
        ("a \u200cb", "U+200C"),
        ("a\u2028b", "U+2028 LINE SEPARATOR"),
        ("a\ud800", "U+D800"),
        ("\U000e0041", "U+E0041 TAG LATIN CAPITAL LETTER A"),
    ],
)
def test_what_controls_or_deceives_is_named(text: str, said: str) -> None:
    """With code point, name and place."""
    found = find_forbidden(text)
    assert found is not None
    assert said in found
