"""A worker's task in a re-fit of the archive: a few shots at a time, each by itself.

JSON in, JSON out, and no archive: it runs in a process of this machine or of a cluster alike, as
long as the shot files can be read under the same path.
"""

from __future__ import annotations

from impactd.aliases import Json
from impactd.jobs import tasks


def fit_chunk(order: Json) -> list[Json]:
    """Fit the shots of an order one by one.

    Return for each ``shot`` and ``fits``, or ``shot`` and ``error`` in words: one bad file does not
    spoil its neighbours.
    """
    found = []
    for one in order["shots"]:
        try:
            fits = tasks.fit_shot({**order, "shots": [one]})["fits"]
        except Exception as error:  # whatever is wrong with one shot is its own answer
            found.append({"shot": one["number"], "error": str(error) or type(error).__name__})
        else:
            found.append({"shot": one["number"], "fits": fits})
    return found
