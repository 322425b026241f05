"""Tests that the folder's page stays true."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

import drivers
from drivers.daq3500.settings import Daq3500Settings
from drivers.usb2637.settings import Usb2637Settings

FOLDER = Path(drivers.__file__).parent


@pytest.mark.parametrize(
    ("page", "driver", "settings"),
    [
        ("README.md", "daq3500", Daq3500Settings),
        ("usb2637/README.md", "usb2637", Usb2637Settings),
    ],
)
def test_the_settings_in_the_page_describe_a_board(page, driver, settings):
    """What a reader copies works."""
    text = (FOLDER / page).read_text(encoding="utf-8")
    block = re.search(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    assert block
    values = tomllib.loads(re.sub(r"^ {3}", "", block[1], flags=re.MULTILINE))["digitizer"]
    assert values.pop("driver") == driver
    assert settings(**values).ring_samples > 1_000_000


def test_every_file_the_pages_name_exists():
    """A renamed file renames its mention."""
    for page in (FOLDER / name / "README.md" for name in ("", "daq3500", "usb2637")):
        named = re.findall(r"`([a-z0-9_/]+\.py)`", page.read_text(encoding="utf-8"))
        for name in named:
            paths = (page.parent / name, FOLDER.parent / name)
            assert any(path.exists() for path in paths), name
