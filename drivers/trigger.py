"""A software trigger with level and hysteresis on offset-binary codes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from drivers.digitizer import TriggerSettings
from drivers.errors import ConfigurationError

_LOWEST_CODE = 0
_HIGHEST_CODE = 65535


def check_trigger(trigger: TriggerSettings) -> None:
    """Refuse trigger settings that describe no record, with a ConfigurationError."""
    finite = math.isfinite(trigger.level_v) and math.isfinite(trigger.hysteresis_v)
    if not finite or trigger.level_v == 0.0:
        raise ConfigurationError(
            f"A trigger level of {trigger.level_v} V cannot be told from the baseline.",
            remedy="Set a level of several times the noise, its sign giving the slope.",
        )
    if not 0.0 <= trigger.hysteresis_v <= abs(trigger.level_v):
        raise ConfigurationError(
            f"A hysteresis of {trigger.hysteresis_v} V does not fit a level of "
            f"{trigger.level_v} V.",
            remedy="Set it between 0 and the level; half the level is a good start.",
        )
    if not 0 <= trigger.pre_trigger_samples < trigger.record_samples:
        raise ConfigurationError(
            f"{trigger.pre_trigger_samples} samples before the trigger do not fit a record of "
            f"{trigger.record_samples}.",
            remedy="Make the record longer than its part before the trigger.",
        )


class LevelTrigger:
    """Finds the first sample that reaches a level after having been away from it.

    The baseline is the offset-binary code of the idle input. The level is above it; its sign gives
    the slope. Before, the signal must have been beyond the hysteresis' distance from the level,
    towards the baseline. A ConfigurationError says that no converter code can reach the level.

    An armed trigger stays armed until it fires, so each block costs one maximum (or minimum) and,
    once per record, one search.
    """

    def __init__(self, baseline_code: float, level_codes: float, hysteresis_codes: float) -> None:
        self._rising = level_codes > 0
        level = baseline_code + level_codes
        toward_baseline = -hysteresis_codes if self._rising else hysteresis_codes
        if self._rising:
            self._fire_code = math.ceil(level)
            self._arm_code = math.ceil(level + toward_baseline)
        else:
            self._fire_code = math.floor(level)
            self._arm_code = math.floor(level + toward_baseline)
        if not _LOWEST_CODE <= self._fire_code <= _HIGHEST_CODE:
            raise ConfigurationError(
                f"The trigger level is at code {self._fire_code}, the converter ends at "
                f"{_LOWEST_CODE} and {_HIGHEST_CODE}.",
                why=f"The baseline lies at code {baseline_code:.0f}; level and range do not fit.",
                remedy="Lower the trigger level, widen range_v or look for an offset at the input.",
            )
        self._armed = False

    def search(self, block: NDArray[np.uint16]) -> int | None:
        """Return the index of the first sample at or beyond the level, if the trigger fires in a
        block.

        The block has the samples that follow those of the last call.
        """
        start = 0
        if not self._armed:
            away = block < self._arm_code if self._rising else block > self._arm_code
            start = int(away.argmax()) if away.size else 0
            if not away.size or not away[start]:
                return None
            self._armed = True
        rest = block[start:]
        if rest.size == 0:
            return None
        reached = rest.max() >= self._fire_code if self._rising else rest.min() <= self._fire_code
        if not reached:
            return None
        hits = rest >= self._fire_code if self._rising else rest <= self._fire_code
        return start + int(np.argmax(hits))
