"""Slots of effects from outside the library are judged and counted."""

from __future__ import annotations

from impactd.bench.slots import VISIBLE, Judged, table


def test_the_table_counts_what_was_visible():
    """Which slot is the likeliest, which are named, and what is right where one stands alone."""
    sure = {"release": 0.0, "contact": 0.9, "mounting": 0.1, "sensor": 0.0, "electronics": 0.0}
    torn = {"release": 0.0, "contact": 0.0, "mounting": 0.0, "sensor": 0.5, "electronics": 0.5}
    judged = [
        Judged("x_a", "contact", 2 * VISIBLE, sure),
        Judged("x_b", "mounting", 2 * VISIBLE, sure),
        Judged("x_c", "electronics", 2 * VISIBLE, torn),
        Judged("x_d", "release", VISIBLE / 2, sure),
    ]
    said = table(judged)
    assert said.startswith("4 campaigns, 3 visible, 3 kinds")
    assert "the likeliest, or as likely: 2 of 3" in said
    assert "among those named: 2 of 3" in said
    assert "right where one is named alone: 1 of 2" in said
