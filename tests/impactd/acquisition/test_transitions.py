"""The transition table: what may happen where, and that nothing else can."""

from __future__ import annotations

import ast
import contextlib
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from impactd.acquisition import transitions
from impactd.acquisition.events import Event
from impactd.acquisition.transitions import (
    BUSY,
    DROP_UNDER_WAY,
    TRANSITIONS,
    IllegalTransitionError,
    Machine,
    State,
    diagram,
    next_state,
)

GOOD_DROP = [
    (Event.STARTED, State.CONNECTING),
    (Event.CONNECTED, State.IDLE),
    (Event.REQUESTED, State.LOADING),
    (Event.SPHERE_HELD, State.CHECKING),
    (Event.CHECKS_PASSED, State.ARMING),
    (Event.STREAMING, State.ARMED),
    (Event.VALVE_OPENED, State.RELEASED),
    (Event.TRIGGERED, State.CAPTURING),
    (Event.RECORD_COMPLETE, State.STORING),
    (Event.STORED, State.IDLE),
    (Event.SHUT_DOWN, State.STOPPED),
]


class Walk(RuleBasedStateMachine):
    """Any events in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.seen: list[tuple[State, Event, State]] = []
        self.machine = Machine(
            lambda before, event, after: self.seen.append((before, event, after))
        )
        self.expected = State.STOPPED

    @rule(event=st.sampled_from(Event))
    def happen(self, event: Event) -> None:
        """Report an event; an unknown one must change nothing."""
        told = len(self.seen)
        if event in TRANSITIONS[self.expected]:
            before = self.machine.apply(event)
            assert before is self.expected
            self.expected = TRANSITIONS[before][event]
            assert self.seen[-1] == (before, event, self.expected)
        else:
            with pytest.raises(IllegalTransitionError) as raised:
                self.machine.apply(event)
            assert (raised.value.state, raised.value.event) == (self.expected, event)
            assert len(self.seen) == told

    @rule()
    def abort(self) -> None:
        """An abort is legal everywhere and never leads into a drop."""
        self.machine.apply(Event.ABORTED)
        assert self.machine.state not in DROP_UNDER_WAY
        self.expected = self.machine.state

    @invariant()
    def as_the_table_says(self) -> None:
        """The machine is where the table leads."""
        assert self.machine.state is self.expected

    @invariant()
    def valve_opens_only_when_armed(self) -> None:
        """No way leads to RELEASED but from ARMED."""
        for before, _, after in self.seen:
            assert after is not State.RELEASED or before is State.ARMED


TestWalk = Walk.TestCase


def test_a_good_drop_walks_through_every_step() -> None:
    """The order of a good drop is the order of the table."""
    machine = Machine()
    for event, state in GOOD_DROP:
        machine.apply(event)
        assert machine.state is state


def test_every_state_can_be_reached_and_left() -> None:
    """No state is an island, and from each one the rig can become idle again."""

    def reachable(start: State) -> set[State]:
        found, todo = {start}, [start]
        while todo:
            new = set(TRANSITIONS[todo.pop()].values()) - found
            found |= new
            todo += new
        return found

    assert reachable(State.STOPPED) == set(State)
    for state in State:
        assert State.IDLE in reachable(state)


@given(st.sampled_from(State), st.sampled_from(Event))
def test_next_state_is_the_table(state: State, event: Event) -> None:
    """`next_state` adds nothing to the table and forgives nothing."""
    if event in TRANSITIONS[state]:
        assert next_state(state, event) is TRANSITIONS[state][event]
    else:
        with pytest.raises(IllegalTransitionError, match=state.value):
            next_state(state, event)


def test_a_drop_can_fail_or_be_aborted_at_every_step() -> None:
    """While a drop is under way, both ways out lead to STOPPING, where it is made safe."""
    for state in DROP_UNDER_WAY:
        assert TRANSITIONS[state][Event.FAILED] is State.STOPPING
        assert TRANSITIONS[state][Event.ABORTED] is State.STOPPING
    assert BUSY.isdisjoint({State.IDLE, State.FAULT, State.STOPPED, State.CONNECTING})


def test_the_table_cannot_be_written() -> None:
    """Nobody changes the table at run time."""
    with pytest.raises(TypeError):
        TRANSITIONS[State.IDLE][Event.TRIGGERED] = State.ARMED  # type: ignore[index]


def test_only_one_of_many_threads_begins_a_drop() -> None:
    """The step out of IDLE is atomic."""
    machine = Machine()
    machine.apply(Event.STARTED)
    machine.apply(Event.CONNECTED)
    won: list[State] = []

    def begin() -> None:
        with contextlib.suppress(IllegalTransitionError):
            won.append(machine.apply(Event.REQUESTED))

    threads = [threading.Thread(target=begin) for _ in range(20)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert won == [State.IDLE]


def test_the_table_does_no_input_or_output() -> None:
    """The module imports neither clock nor file nor network nor driver."""
    tree = ast.parse(Path(transitions.__file__).read_text(encoding="utf-8"))
    names = {
        name.split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, (ast.Import, ast.ImportFrom))
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
        )
    }
    allowed = {"__future__", "threading", "collections", "enum", "types", "impactd"}
    assert names <= allowed


def test_the_readme_shows_the_generated_diagram() -> None:
    """The picture in the folder's README is the table of today."""
    readme = Path(transitions.__file__).with_name("README.md").read_text(encoding="utf-8")
    assert f"```mermaid\n{diagram()}\n```" in readme, (
        "paste the output of `python -m impactd.acquisition.transitions` into the README"
    )
