"""The table of drops: what was asked for, how far it came, and why it failed."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass

from analysis.campaign import Environment
from impactd.storage.errors import DropStateError, IdempotencyConflictError, NotFoundError
from impactd.storage.index import Index
from impactd.storage.materials_json import environment_from_text, environment_to_text
from impactd.storage.problem import Problem
from impactd.storage.request_key import bare_key, client_part
from impactd.storage.timestamp import utc_now

ACTIVE_STATES = ("requested", "arming", "armed", "released", "capturing", "storing")
FINAL_STATES = ("stored", "analysed", "failed", "aborted", "interrupted")

_SELECT = (
    "SELECT drops.*, shots.number AS shot FROM drops LEFT JOIN shots ON shots.number=drops.number "
)


@dataclass(frozen=True)
class DropRequest:
    """The request of a drop."""

    sphere: str
    surface: str
    drop_height_m: float
    """Fall height of the sphere's lowest point. [m]"""
    operator: str
    """Who hangs the sphere."""
    environment: Environment | None = None
    """As the technician read it; it counts instead of what the settings say."""


@dataclass(frozen=True)
class Drop:
    """A request and what became of it."""

    number: int
    """Short, from 1, never used twice; also the number of its shot."""
    state: str
    """One of ``ACTIVE_STATES`` or ``FINAL_STATES``; ``stored`` may still become ``analysed``."""
    request: DropRequest
    owner: str
    """Name of the token that asked."""
    shot: int | None
    """Its shot once that is durable."""
    problem: Problem | None
    """Why it failed; on a stored drop, why it could not be analysed."""
    requested_utc: str
    updated_utc: str
    calibration: int | None
    """The calibration run it belongs to."""
    idempotency_key: str | None
    """As it is stored: with the namespace of `request_key`."""
    rebound_height_m: float | None = None
    """How high the sphere came back, as somebody entered it. [m]"""
    u_rebound_height_m: float | None = None
    """Its standard uncertainty. [m]"""

    @property
    def client_key(self) -> str | None:
        """Return the key as its client sent it."""
        return client_part(self.idempotency_key)


class DropTable:
    """The table of drops."""

    def __init__(self, index: Index) -> None:
        self._index = index

    def begin(
        self,
        number: int,
        request: DropRequest,
        *,
        owner: str,
        idempotency_key: str | None,
        calibration: int | None,
    ) -> Drop:
        """Write the row of a new drop; the caller holds the transaction that drew the number."""
        now = utc_now()
        self._index.write(
            "INSERT INTO drops (number, state, sphere, surface, drop_height_m, operator, owner, "
            "idempotency_key, calibration, requested_utc, updated_utc, environment) "
            "VALUES (?, 'requested', ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                number,
                request.sphere,
                request.surface,
                request.drop_height_m,
                request.operator,
                owner,
                idempotency_key,
                calibration,
                now,
                now,
                environment_to_text(request.environment),
            ),
        )
        return self.get(number)

    def restore(self, drop: Drop) -> None:
        """Write a drop as it was; for rebuilding the index."""
        self._index.write(
            "INSERT OR REPLACE INTO drops (number, state, sphere, surface, drop_height_m, "
            "operator, owner, idempotency_key, calibration, problem, requested_utc, updated_utc, "
            "rebound_height_m, u_rebound_height_m, environment) "
            "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                drop.number,
                drop.state,
                drop.request.sphere,
                drop.request.surface,
                drop.request.drop_height_m,
                drop.request.operator,
                drop.owner,
                drop.idempotency_key,
                drop.calibration,
                drop.problem.to_text() if drop.problem else None,
                drop.requested_utc,
                drop.updated_utc,
                drop.rebound_height_m,
                drop.u_rebound_height_m,
                environment_to_text(drop.request.environment),
            ),
        )

    def set_rebound(self, number: int, rebound_height_m: float, u_m: float) -> Drop:
        """Write how high the sphere came back; raise NotFoundError."""
        with self._index.transaction():
            self.get(number)
            self._index.write(
                "UPDATE drops SET rebound_height_m=?, u_rebound_height_m=?, updated_utc=? "
                "WHERE number=?",
                (rebound_height_m, u_m, utc_now(), number),
            )
            return self.get(number)

    def by_key(self, key: str, request: DropRequest) -> Drop | None:
        """Return the drop of an idempotency key, ``None`` when the key is new.

        A key without namespace is its owner's alone. Raises IdempotencyConflictError if the key
        belongs to another request.
        """
        row = self._index.row(_SELECT + "WHERE idempotency_key=?", (key,)) or self._by_bare(key)
        if row is None:
            return None
        drop = _drop_of(row)
        if drop.request != request:
            raise IdempotencyConflictError(key, drop.number)
        return drop

    def _by_bare(self, key: str) -> sqlite3.Row | None:
        bare = bare_key(key)
        if bare is None:
            return None
        owned = "WHERE idempotency_key=? AND owner=(SELECT name FROM tokens WHERE id=?)"
        return self._index.row(_SELECT + owned, (bare.key, bare.token))

    def get(self, number: int) -> Drop:
        """Return one drop; raise NotFoundError."""
        row = self._index.row(_SELECT + "WHERE drops.number=?", (number,))
        if row is None:
            raise NotFoundError("drop", number)
        return _drop_of(row)

    def newest(self, *, limit: int = 50, before: int | None = None) -> list[Drop]:
        """Return drops, newest first, those below ``before`` only."""
        rows = self._index.rows(
            _SELECT + "WHERE ? IS NULL OR drops.number < ? ORDER BY drops.number DESC LIMIT ?",
            (before, before, limit),
        )
        return [_drop_of(row) for row in rows]

    def active(self) -> list[Drop]:
        """Return the drops that are under way, oldest first."""
        marks = ", ".join("?" * len(ACTIVE_STATES))
        rows = self._index.rows(
            _SELECT + f"WHERE state IN ({marks}) ORDER BY drops.number",
            ACTIVE_STATES,
        )
        return [_drop_of(row) for row in rows]

    def of_calibration(self, calibration: int) -> list[Drop]:
        """Return the drops of a calibration run in their order."""
        rows = self._index.rows(
            _SELECT + "WHERE calibration=? ORDER BY drops.number", (calibration,)
        )
        return [_drop_of(row) for row in rows]

    def set_state(self, number: int, state: str, problem: Problem | None = None) -> Drop:
        """Write the next state of a drop.

        Raises
        ------
        DropStateError
            If the state is unknown, or the drop has ended and is not going from ``stored`` to
            ``analysed`` (or back to ``stored``, when a repeated fit fails).
        NotFoundError
            If the index has no such drop.
        """
        with self._index.transaction():
            drop = self.get(number)
            both_kept = {drop.state, state} <= {"stored", "analysed"}
            if state not in ACTIVE_STATES + FINAL_STATES or (
                drop.state in FINAL_STATES and not both_kept
            ):
                raise DropStateError(number, drop.state, state)
            self._index.write(
                "UPDATE drops SET state=?, problem=?, updated_utc=? WHERE number=?",
                (state, problem.to_text() if problem else None, utc_now(), number),
            )
            return self.get(number)


def _drop_of(row: sqlite3.Row) -> Drop:
    return Drop(
        number=row["number"],
        state=row["state"],
        request=DropRequest(
            row["sphere"],
            row["surface"],
            row["drop_height_m"],
            row["operator"],
            environment_from_text(row["environment"]),
        ),
        owner=row["owner"],
        shot=row["shot"],
        problem=Problem.from_text(row["problem"]),
        requested_utc=row["requested_utc"],
        updated_utc=row["updated_utc"],
        calibration=row["calibration"],
        idempotency_key=row["idempotency_key"],
        rebound_height_m=row["rebound_height_m"],
        u_rebound_height_m=row["u_rebound_height_m"],
    )
