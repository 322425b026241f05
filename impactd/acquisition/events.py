"""The events of the transition table.

The names are past or passive on purpose: an event is something that has happened, so the table
can only say what the state is now. The service decides what to do next.
"""

from __future__ import annotations

from enum import Enum


class Event(Enum):
    """Something that happened; the value is its name in logs and diagrams."""

    STARTED = "started"
    """The daemon asks for the devices."""
    CONNECTED = "connected"
    """Digitizer and valve answered, and the valve is safe."""
    REQUESTED = "requested"
    """A drop was asked for and its row is durable."""
    SPHERE_HELD = "sphere held"
    """The gauge says so, or there is no gauge and the time to hang it is over."""
    CHECKS_PASSED = "checks passed"
    """Baseline, noise, disk and calibration are as they should be."""
    STREAMING = "streaming"
    """The digitizer streams and its pre-trigger part is filled."""
    VALVE_OPENED = "valve opened"
    """The release command was handed over."""
    TRIGGERED = "triggered"
    """The signal crossed the level."""
    RECORD_COMPLETE = "record complete"
    """All samples are in memory and none was lost."""
    STORED = "stored"
    """The shot would survive a power cut."""
    FAILED = "failed"
    """A step could not be done; the drop is lost, the rig may be sound."""
    ABORTED = "aborted"
    """Somebody asked for an end."""
    MADE_SAFE = "made safe"
    """Vacuum on, digitizer stopped, and nothing speaks against the next drop."""
    RIG_DOUBTED = "rig doubted"
    """A device is lost or did not do what it was told."""
    RETRIED = "retried"
    """The devices are asked for again, by the service or by a person's acknowledgement."""
    SHUT_DOWN = "shut down"
    """The daemon ends."""
