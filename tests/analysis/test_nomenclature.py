"""The glossary is complete enough to be trusted: no double symbol, and its names are the code's."""

from __future__ import annotations

from pathlib import Path

import pytest

import analysis
from analysis.nomenclature import GLOSSARY, term


def test_every_symbol_has_one_meaning() -> None:
    """No symbol stands twice, and none lacks a unit, a meaning or a source."""
    symbols = [t.symbol for t in GLOSSARY]
    assert len(set(symbols)) == len(symbols)
    assert all(t.unit and t.meaning and t.source for t in GLOSSARY)


def test_names_with_a_unit_suffix_are_used_by_the_code() -> None:
    """Each name the glossary gives as an identifier occurs in the analysis."""
    code = "".join(
        p.read_text(encoding="utf-8")
        for p in Path(analysis.__path__[0]).rglob("*.py")
        if p.name != "nomenclature.py"
    )
    for entry in GLOSSARY:
        if entry.name.isidentifier():
            assert entry.name in code, entry.symbol


def test_terms_are_found_by_symbol() -> None:
    """A symbol leads to its entry; an unknown one is an error."""
    assert term("K").unit == "N m^-1.5"
    with pytest.raises(KeyError):
        term("Q")
