"""What a person hears of the other end of a bridge: that it is away, and that it is back."""

from __future__ import annotations

from collections.abc import Callable

Say = Callable[[str], None]


def first_error(error: BaseException) -> BaseException:
    """Return the first error of a group, however deep; else the error itself."""
    while isinstance(error, BaseExceptionGroup):
        error = error.exceptions[0]
    return error


class OtherEnd:
    """A broker, receiver or catalogue that may be away; each change is said once.

    Parameters
    ----------
    name : str
        What it is, at the beginning of a sentence.
    say : callable
        Takes a sentence.
    """

    def __init__(self, name: str, say: Say) -> None:
        self._name, self._say = name, say
        self._there: bool | None = None

    def is_away(self, why: str | BaseException) -> None:
        """Say that it does not take what is sent; it is tried again."""
        if self._there is not False:
            said = why if isinstance(why, str) else _sentence(first_error(why))
            self._say(f"{self._name} cannot be used now: {said}. It is tried again until it can.")
        self._there = False

    def is_there(self) -> None:
        """Say so if it was away, or nobody knew."""
        if not self._there:
            self._say(f"{self._name} is connected.")
        self._there = True


def _sentence(error: BaseException) -> str:
    """Return the first line of what an error says, or else what it is called."""
    return str(error).partition("\n")[0].rstrip(".") or type(error).__name__
