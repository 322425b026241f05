"""Idempotency keys belong to a token and to a kind of request."""

from __future__ import annotations

import pytest

from impactd.storage.archive import Archive, DropRequest, IdempotencyConflictError
from impactd.storage.request_key import CALIBRATION, RequestKey

REQUEST = DropRequest("acetal", "aluminium", 0.03, "ab")
OTHER = DropRequest("steel", "aluminium", 0.03, "ab")


def _drop(archive: Archive, key: str, request: DropRequest = REQUEST, owner: str = "anna") -> int:
    return archive.begin_drop(request, owner=owner, idempotency_key=key)[0].number


def test_two_tokens_may_use_the_same_key(archive: Archive) -> None:
    """Each has its own drop, and each one's repetition finds it."""
    first = _drop(archive, RequestKey("token 1", "k").text)
    second = _drop(archive, RequestKey("token 2", "k").text, OTHER, "bob")

    assert first != second
    assert _drop(archive, RequestKey("token 1", "k").text) == first
    assert _drop(archive, RequestKey("token 2", "k").text, OTHER, "bob") == second
    assert archive.drop(first).client_key == "k"
    with pytest.raises(IdempotencyConflictError):
        archive.drop_by_key(RequestKey("token 1", "k").text, OTHER)


def test_a_clients_key_never_meets_one_of_a_calibration(archive: Archive) -> None:
    """Not the present form, and not the one that older archives hold."""
    _drop(archive, "calibration-1-1-0", owner="calibration")
    own = _drop(archive, RequestKey(CALIBRATION, "1-1-0").text, owner="calibration")
    archive.tokens.create("calibration")

    for key in ("calibration-1-1-0", "calibration 1-1-0", "1-1-0"):
        assert archive.drop_by_key(RequestKey("token 1", key).text, REQUEST) is None
    assert archive.drop(own).client_key == "calibration 1-1-0"


def test_a_key_of_an_older_archive_is_found_by_its_owner_alone(archive: Archive) -> None:
    """An old client's repetition drops nothing; another token's key of that text is new."""
    archive.tokens.create("anna")
    archive.tokens.create("bob")
    old = _drop(archive, "k")

    assert _drop(archive, RequestKey("token 1", "k").text) == old
    assert _drop(archive, RequestKey("token 2", "k").text, owner="bob") != old


def test_jobs_of_two_kinds_may_use_the_same_key(archive: Archive) -> None:
    """The kind is part of the namespace; a job of an older archive is found by its own request."""
    old = archive.jobs.enqueue("fit_shot", {"shot": 1}, "shot 1", key="k")
    fit, diagnosis = RequestKey("token 1 fit", "k").text, RequestKey("token 1 diagnosis", "k").text

    assert archive.jobs.enqueue("fit_shot", {"shot": 1}, "shot 1", key=fit) == old
    other = archive.jobs.enqueue("fit_shot", {"shot": 2}, "shot 2", key=fit)
    third = archive.jobs.enqueue("diagnose", {"shots": [1]}, "1 shot", key=diagnosis)
    assert len({old.id, other.id, third.id}) == 3


def test_a_slot_from_a_key_is_its_tokens(archive: Archive) -> None:
    """An agreed slot is everybody's; an old bare key is found by the token that sent it."""
    archive.tokens.create("anna")
    old, _ = archive.calibrations.begin("k", [], "anna")

    same = RequestKey("token 1 calibration", "k").text
    assert archive.calibrations.begin(same, [], "anna") == (old, False)
    assert archive.calibrations.by_slot(same) == old
    another = RequestKey("token 2 calibration", "k").text
    assert archive.calibrations.by_slot(another) is None
    assert archive.calibrations.begin(another, [], "bob")[1]
