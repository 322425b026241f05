"""A refused recording in a line."""

from __future__ import annotations

from impactd.reports.rejected import rejected_words


def test_a_recording_of_no_file_has_no_empty_brackets():
    """The JSON path is told where there is one."""
    item = {"name": "shot 3", "path": "", "reason": "nothing leaves the baseline."}
    assert rejected_words(item) == "Rejected: shot 3: nothing leaves the baseline."
    told = rejected_words(item | {"path": "$.shots[2]"})
    assert told == "Rejected: shot 3 ($.shots[2]): nothing leaves the baseline."
