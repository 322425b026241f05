"""What went wrong, as the one sentence a person reads."""

from __future__ import annotations


class Failure(Exception):  # noqa: N818 - read as a noun: `raise Failure("...")` ends a command
    """A command ends with exit code 1 and the sentence it was made with."""


def sentence(error: BaseException) -> str:
    """Return an error as one line.

    Parameters
    ----------
    error : BaseException
        Anything a command may raise.

    Returns
    -------
    str
        Without line breaks; an error nobody foresaw says how to see more.
    """
    said = " ".join(str(error).split())
    if _is_ours(error):
        return f"impactd: {said}"
    if isinstance(error, OSError) and error.strerror:
        where = f" {error.filename}" if error.filename else ""
        return f"impactd: cannot use{where or ' a file'}: {error.strerror}."
    return (
        f"impactd: failed unexpectedly ({type(error).__name__}: {said or 'no message'}); "
        "set IMPACTD_TRACEBACK=1 and run it again to see where, then report it."
    )


def _is_ours(error: BaseException) -> bool:
    """Our own errors are written for people; those of libraries are not."""
    module = type(error).__module__.partition(".")[0]
    return module in ("impactd", "drivers", "analysis")
