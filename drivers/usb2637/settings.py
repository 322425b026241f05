"""The settings of the digitizer that the rig's owner must supply."""

from __future__ import annotations

from dataclasses import dataclass

from drivers.errors import ConfigurationError
from drivers.stream_settings import StreamSettings
from drivers.usb2637.protocol import (
    CHANNELS,
    FASTEST_DIVISOR,
    RANGE_V,
    SLOWEST_DIVISOR,
    pacer_rate_hz,
)


@dataclass(frozen=True, kw_only=True)
class Usb2637Settings(StreamSettings):
    """Input, rate and buffers of one board.

    A ConfigurationError says that they cannot describe a real board.
    """

    pacer_divisor: int = FASTEST_DIVISOR
    """N in 64 MHz/(N + 1), 63 to 24 999; 63 for a nominal 1 MHz, the most."""

    def __post_init__(self) -> None:
        if not 0 <= self.channel < CHANNELS:
            raise ConfigurationError(
                f"The digitizer has no channel {self.channel}.",
                remedy=f"Set channel to 0 to {CHANNELS - 1}.",
            )
        if self.range_v != RANGE_V:
            raise ConfigurationError(
                f"The digitizer has no range of +/-{self.range_v} V.",
                why="The maker's library offers one range on this board.",
                remedy=f"Set range_v to {RANGE_V}.",
            )
        if not FASTEST_DIVISOR <= self.pacer_divisor <= SLOWEST_DIVISOR:
            raise ConfigurationError(
                f"A pacer divisor of {self.pacer_divisor} is none of this board's.",
                why=f"It converts at 64 MHz/(N + 1), from {pacer_rate_hz(SLOWEST_DIVISOR):.0f} Hz "
                f"to {pacer_rate_hz(FASTEST_DIVISOR):.0f} Hz.",
                remedy=f"Set pacer_divisor to {FASTEST_DIVISOR} for 1 MHz, to 127 for 500 kHz.",
            )
        super().__post_init__()

    @property
    def nominal_rate_hz(self) -> float:
        """The rate that the pacer's divisor asks for."""
        return pacer_rate_hz(self.pacer_divisor)
