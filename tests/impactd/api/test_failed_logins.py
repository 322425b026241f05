"""Failed authentication is told, without filling the log, and slowed down."""

from __future__ import annotations

import anyio
import structlog.testing

from impactd.api.failed_logins import FailedLogins


def test_an_invented_token_is_told_with_its_address(rig):
    """The log says from where, what failed and on which path; never the token."""
    # As a proxy on this machine says it: an address that no other test of this minute has used up.
    origin = {"X-Forwarded-For": "192.0.2.77"}
    header = {"Authorization": "Bearer impactd_invented"}
    with structlog.testing.capture_logs() as lines:
        assert rig.anybody.get("/v1/drops", headers=origin | header).status_code == 401
        assert rig.anybody.post("/v1/abort", headers=origin | header).status_code == 401
        cookie = {"Cookie": "impactd_session=invented"}
        assert rig.anybody.get("/v1/shots", headers=origin | cookie).status_code == 401
    told = [line for line in lines if line["event"] == "authentication failed"]
    assert [(one["address"], one["what"], one["path"]) for one in told] == [
        ("192.0.2.77", "token", "/v1/drops"),
        ("192.0.2.77", "token", "/v1/abort"),
        ("192.0.2.77", "session", "/v1/shots"),
    ]
    assert "invented" not in str(lines)


def test_after_five_failures_each_waits_longer_up_to_a_second():
    """A person is not slowed down; a program that guesses is."""
    now_s = [0.0]
    failed = FailedLogins(lambda: now_s[0])
    delays = [failed.note("192.0.2.1", "token", "/v1/drops") for _ in range(20)]
    assert delays[:5] == [0.0] * 5
    assert 0 < delays[5] < delays[6] < delays[7]
    assert delays[-1] == 1.0
    assert failed.note("192.0.2.2", "token", "/v1/drops") == 0.0
    now_s[0] = 61.0
    assert failed.note("192.0.2.1", "token", "/v1/drops") == 0.0


def test_an_address_gets_five_lines_a_minute_and_then_a_count():
    """A thousand failures are six lines."""
    now_s = [0.0]
    with structlog.testing.capture_logs() as lines:
        failed = FailedLogins(lambda: now_s[0])
        for _ in range(1000):
            failed.note("192.0.2.1", "token", "/v1/drops")
        now_s[0] = 61.0
        failed.summarize()
        failed.summarize()
    assert [line["event"] for line in lines] == ["authentication failed"] * 5 + [
        "more failed authentication"
    ]
    assert lines[-1]["times"] == 995


def test_many_addresses_fill_neither_log_nor_memory():
    """A proxy's header may name any address, and may hold anything."""
    with structlog.testing.capture_logs() as lines:
        failed = FailedLogins()
        for number in range(5000):
            failed.note(f"192.0.{number // 250}.{number % 250}", "token", "/")
        failed.note("\x1b[31m", "token", "/")
    assert len(lines) <= 60
    assert len(failed._by_address) <= 1024
    assert "unknown" in failed._by_address


def test_few_refusals_wait_at_a_time():
    """Beyond sixty-four sleepers a refusal is answered at once, so waiting costs no memory."""
    failed = FailedLogins()
    most = []

    async def crowd() -> None:
        async with anyio.create_task_group() as group:
            for _ in range(200):
                group.start_soon(failed.slow_down, 0.2)
            await anyio.sleep(0.05)
            most.append(failed._sleepers)

    anyio.run(crowd)
    assert most == [64]
    assert failed._sleepers == 0
