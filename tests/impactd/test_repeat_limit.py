"""A library that says the same again and again is written once a minute."""

from __future__ import annotations

import logging

from impactd.repeat_limit import RepeatLimit


def test_a_message_is_written_once_a_minute():
    """Ten thousand accept failures are one line; the next minute's says how many there were."""
    now_s = [0.0]
    limit = RepeatLimit(lambda: now_s[0])

    def through(message: str) -> str | None:
        record = logging.LogRecord("asyncio", logging.ERROR, "", 0, message, (), None)
        return record.getMessage() if limit.filter(record) else None

    written = [through(f"out of descriptors\nsocket {number}") for number in range(10_000)]
    assert [line for line in written if line] == ["out of descriptors\nsocket 0"]
    assert through("something else") == "something else"
    now_s[0] = 61.0
    assert through("out of descriptors") == "out of descriptors (and 9999 times before)"


def test_messages_with_values_in_them_take_no_memory():
    """The oldest are forgotten."""
    limit = RepeatLimit()
    for number in range(5000):
        limit.filter(logging.LogRecord("x", logging.ERROR, "", 0, f"value {number}", (), None))
    assert len(limit._seen) <= 256
