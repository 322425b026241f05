"""The model's curve of a fit, packed for drawing and kept beside the fit's numbers."""

from __future__ import annotations

import base64
import zlib
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from impactd.aliases import Json

if TYPE_CHECKING:
    from analysis.fit.shot_fit import ShotFit

_TYPE = np.dtype("<i4")
_STEPS = 30_000
"""Steps from zero to the highest sample: finer than the converter's, a screen's and the noise."""


def curve_of(fitted: ShotFit) -> Json:
    """Return the model's curve over the fit window of one shot, as `packed`.

    ``first`` is the index of the curve's first sample in the record.
    """
    return packed(fitted.prediction, first=int(fitted.item.window.first))


def packed(samples: NDArray[np.float64], *, first: int) -> Json:
    """Return a curve, shape (n,), in a fifth of the size of numbers as text.

    It has ``first`` (index of the first sample in its record), ``step`` (in the unit of the signal)
    and ``differences``: from sample to sample, in steps, as little-endian 32-bit integers,
    deflated, in base64.
    """
    step = float(np.max(np.abs(samples), initial=0.0)) / _STEPS or 1.0
    codes = np.round(samples / step).astype(_TYPE)
    differences = np.diff(codes, prepend=_TYPE.type(0)).astype(_TYPE)
    content = base64.b64encode(zlib.compress(differences.tobytes(), 9)).decode("ascii")
    return {"first": first, "step": step, "differences": content}


def samples_of(curve: Json) -> NDArray[np.float64]:
    """Return the samples of a curve from `packed`, shape (n,), to half a step."""
    content = zlib.decompress(base64.b64decode(curve["differences"]))
    differences = np.frombuffer(content, dtype=_TYPE).astype(np.float64)
    return np.asarray(np.cumsum(differences) * float(curve["step"]), dtype=np.float64)
