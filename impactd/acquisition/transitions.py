"""Every state of the rig and every transition, in one table.

There is no I/O here, no clock and no thread: the service does things, then tells `Machine` what
happened. An event that the table does not know in a state raises `IllegalTransitionError` and
changes nothing, so a slip in the service shows at once instead of moving a valve at a wrong time.

``README.md`` in this folder shows the diagram; `diagram` generates it and a test compares.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from enum import Enum
from types import MappingProxyType

from impactd.acquisition.events import Event


class State(Enum):
    """The state of the rig; the value is what clients see."""

    STOPPED = "STOPPED"
    """Before the daemon started the rig and after it ended: nothing may be asked."""
    CONNECTING = "CONNECTING"
    """The devices are being opened, loaded and tested."""
    IDLE = "IDLE"
    """Vacuum on, digitizer stopped: the one state that takes a drop."""
    LOADING = "LOADING"
    """A drop exists and its sphere is being hung."""
    CHECKING = "CHECKING"
    """The sphere is held; baseline and noise are looked at."""
    ARMING = "ARMING"
    """The digitizer is being started."""
    ARMED = "ARMED"
    """Samples stream and the past is long enough; the valve is still closed."""
    RELEASED = "RELEASED"
    """The valve is open and the sphere falls."""
    CAPTURING = "CAPTURING"
    """The impact was seen; the record is filling up."""
    STORING = "STORING"
    """The record is in memory and on its way to the disk; nothing moves any more."""
    STOPPING = "STOPPING"
    """A drop has ended early; vacuum goes on and the digitizer stops."""
    FAULT = "FAULT"
    """The rig itself is in doubt; nothing moves until it was reached and checked again."""


_S, _E = State, Event

# The order of the rows is the order of a good drop; the rest is ways out.
_TABLE: dict[State, dict[Event, State]] = {
    _S.STOPPED: {
        _E.STARTED: _S.CONNECTING,
        # Aborting is allowed everywhere: an operator who is afraid must never read "illegal".
        _E.ABORTED: _S.STOPPED,
        _E.SHUT_DOWN: _S.STOPPED,
    },
    _S.CONNECTING: {
        _E.CONNECTED: _S.IDLE,
        _E.FAILED: _S.FAULT,
        # Nothing of a drop is under way; the valve is made safe and connecting goes on.
        _E.ABORTED: _S.CONNECTING,
        _E.SHUT_DOWN: _S.STOPPED,
    },
    _S.IDLE: {
        _E.REQUESTED: _S.LOADING,
        _E.ABORTED: _S.IDLE,
        # A device can be unplugged while nobody asks anything of it.
        _E.RIG_DOUBTED: _S.FAULT,
        _E.SHUT_DOWN: _S.STOPPED,
    },
    _S.LOADING: {
        _E.SPHERE_HELD: _S.CHECKING,
        _E.FAILED: _S.STOPPING,
        _E.ABORTED: _S.STOPPING,
    },
    # Checked after loading, not before: a pump that hums only with a closed tube is seen here.
    _S.CHECKING: {
        _E.CHECKS_PASSED: _S.ARMING,
        _E.FAILED: _S.STOPPING,
        _E.ABORTED: _S.STOPPING,
    },
    _S.ARMING: {
        _E.STREAMING: _S.ARMED,
        _E.FAILED: _S.STOPPING,
        _E.ABORTED: _S.STOPPING,
    },
    # TRIGGERED is not accepted here: an impact before the release is somebody's elbow. The
    # service looks at the clock after RELEASED and fails a record that came too early.
    _S.ARMED: {
        _E.VALVE_OPENED: _S.RELEASED,
        _E.FAILED: _S.STOPPING,
        _E.ABORTED: _S.STOPPING,
    },
    # The sphere cannot be called back; an abort here still closes the valve and the record.
    _S.RELEASED: {
        _E.TRIGGERED: _S.CAPTURING,
        _E.FAILED: _S.STOPPING,
        _E.ABORTED: _S.STOPPING,
    },
    _S.CAPTURING: {
        _E.RECORD_COMPLETE: _S.STORING,
        _E.FAILED: _S.STOPPING,
        _E.ABORTED: _S.STOPPING,
    },
    _S.STORING: {
        _E.STORED: _S.IDLE,
        _E.FAILED: _S.STOPPING,
        # Whole and safe data is never thrown away: the valve is made safe, the shot is kept.
        _E.ABORTED: _S.STORING,
        # The shot is stored, and yet the valve did not close: the next drop must wait.
        _E.RIG_DOUBTED: _S.FAULT,
    },
    _S.STOPPING: {
        _E.MADE_SAFE: _S.IDLE,
        _E.RIG_DOUBTED: _S.FAULT,
        _E.ABORTED: _S.STOPPING,
        # The service thread can learn of a failure a moment after an abort came from another
        # thread, and the other way round; the first one has said where to go.
        _E.FAILED: _S.STOPPING,
    },
    _S.FAULT: {
        _E.RETRIED: _S.CONNECTING,
        _E.ABORTED: _S.FAULT,
        _E.SHUT_DOWN: _S.STOPPED,
    },
}

TRANSITIONS: Mapping[State, Mapping[Event, State]] = MappingProxyType(
    {state: MappingProxyType(row) for state, row in _TABLE.items()}
)

# In these states a drop is under way: an abort ends it.
DROP_UNDER_WAY = frozenset(
    {_S.LOADING, _S.CHECKING, _S.ARMING, _S.ARMED, _S.RELEASED, _S.CAPTURING}
)
# SHUT_DOWN has no row where a drop is under way: the service aborts first and waits, so that every
# drop ends with a reason.
BUSY = DROP_UNDER_WAY | {_S.STORING, _S.STOPPING}

Listener = Callable[[State, Event, State], None]


class IllegalTransitionError(Exception):
    """An event came in a state that does not know it; nothing was changed."""

    def __init__(self, state: State, event: Event) -> None:
        self.state = state
        self.event = event
        known = ", ".join(sorted(e.value for e in TRANSITIONS[state]))
        super().__init__(
            f"{event.value!r} cannot happen in state {state.value} (known there: {known}). "
            "The service and the table disagree: this is a defect, please report it."
        )


def next_state(state: State, event: Event) -> State:
    """Return where an event leads; raise IllegalTransitionError if the table has no such row."""
    try:
        return TRANSITIONS[state][event]
    except KeyError:
        raise IllegalTransitionError(state, event) from None


class Machine:
    """The present state, safe to move from any thread.

    ``listener`` is told of each change (before, event, after) while the lock is held; it must be
    quick.
    """

    def __init__(self, listener: Listener | None = None) -> None:
        self._state = State.STOPPED
        self._listener = listener
        # Re-entrant, because a listener may look at the state.
        self._lock = threading.RLock()

    @property
    def state(self) -> State:
        """The present state."""
        with self._lock:
            return self._state

    def apply(self, event: Event) -> State:
        """Move on and return the state before.

        Raises IllegalTransitionError if the table has no such row; the state stays.
        """
        with self._lock:
            before = self._state
            after = next_state(before, event)
            self._state = after
            if self._listener is not None:
                self._listener(before, event, after)
            return before


def diagram() -> str:
    """Return the table as a Mermaid ``stateDiagram-v2``, one arrow per pair of states."""
    lines = ["stateDiagram-v2", "    [*] --> STOPPED"]
    for state, row in TRANSITIONS.items():
        arrows: dict[State, list[str]] = {}
        for event, after in row.items():
            # A self-loop of an abort says "allowed, and changes nothing": prose, not an arrow.
            if after is not state:
                arrows.setdefault(after, []).append(event.value)
        lines.extend(
            f"    {state.value} --> {after.value}: {', '.join(events)}"
            for after, events in arrows.items()
        )
    return "\n".join(lines)


if __name__ == "__main__":
    print(diagram())
