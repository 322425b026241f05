"""The audit of `make check` tells bad news, and tells when it could not look."""

from __future__ import annotations

import json

from .dependency_audit import verdict


def test_a_known_vulnerability_is_named_with_its_cure() -> None:
    """Package, version, advisory and the version that mends it."""
    known = {"id": "PYSEC-2026-1", "fix_versions": ["2.0"]}
    packages = [{"name": "x", "version": "1.0", "vulns": [known]}]
    assert verdict(json.dumps({"dependencies": packages})) == (
        ["x 1.0: PYSEC-2026-1, mended in 2.0"],
        "",
    )


def test_what_could_not_be_looked_up_is_counted() -> None:
    """An audit that saw nothing is not a clean one."""
    packages = [
        {"name": "x", "skip_reason": "not found"},
        {"name": "y", "version": "1", "vulns": []},
    ]
    found, incomplete = verdict(json.dumps({"dependencies": packages}))
    assert found == []
    assert incomplete == "1 of 2 packages could not be looked up"


def test_no_answer_at_all_is_said() -> None:
    """Without network there is no report."""
    assert verdict("") == ([], "pip-audit reached no advisory database")
