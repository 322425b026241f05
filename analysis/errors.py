"""Every error the analysis raises, drawn as one tree.

::

    AnalysisError
    ├── ParameterOutOfRangeError    a quantity no such rig can have
    ├── ShotRejectedError           one recording that cannot be used
    └── UnknownModelError           a model name this version does not know

A fit that does not converge is not an error: see ``analysis.fit.result.Outcome``.
"""

from __future__ import annotations


class AnalysisError(Exception):
    """The analysis was asked for something it cannot do."""


class ParameterOutOfRangeError(AnalysisError):
    """A quantity, named with its unit suffix, has a value that no such rig can have."""

    def __init__(self, name: str, value: object, allowed: str) -> None:
        self.name = name
        self.value = value
        self.allowed = allowed
        super().__init__(f"{name} is {value!r}; it must be {allowed}.")


class ShotRejectedError(AnalysisError):
    """One recording cannot be used."""


class UnknownModelError(AnalysisError):
    """A model name this version does not know."""
