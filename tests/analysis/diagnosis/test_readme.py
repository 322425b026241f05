"""The folder's page says where everything is."""

from __future__ import annotations

import re
from pathlib import Path

import analysis.diagnosis

FOLDER = Path(analysis.diagnosis.__file__).parent
PAGE = (FOLDER / "README.md").read_text(encoding="utf-8")


def test_the_page_names_every_module_beside_its_room():
    """No file is missing there, and none stands there that is gone."""
    named = set()
    for line in re.findall(r"^\|.*\|$", PAGE, flags=re.MULTILINE):
        where, _, rest = line.strip("|").partition("|")[2].partition("|")
        room = "".join(re.findall(r"`(\w+/)`", where))
        named |= set(re.findall(r"`([\w/]+\.py)`", where))
        named |= {room + file for file in re.findall(r"`(\w+\.py)`", rest)}
    modules = {p.relative_to(FOLDER).as_posix() for p in FOLDER.rglob("*.py")}
    assert named == {m for m in modules if not m.endswith("__init__.py")}
