"""The settings of the digitizer that the rig's owner must supply."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from drivers.daq3500.registers import pacer_rate_hz, pacer_words, scan_entry
from drivers.stream_settings import StreamSettings


@dataclass(frozen=True, kw_only=True)
class Daq3500Settings(StreamSettings):
    """Identity, input, rate and buffers of one board.

    A ConfigurationError says that they cannot describe a real board.
    """

    vendor_id: int
    product_id_unloaded: int
    product_id_loaded: int
    """USB ids before and after the firmware is loaded. Those of a 3500 are NOT KNOWN, hence
    required; a Personal Daq/3001 has 0x0622 (vendor), 0x0470, 0x2c01."""
    firmware_file: Path | None = None
    """This and ``fpga_file`` are the user's images for an unloaded board; formats in
    `drivers.daq3500.firmware`."""
    differential: bool = False
    """Whether two inputs are subtracted."""
    settling_code: int = 0
    """0 for 1 us, 1 for 5 us, 2 for 10 us, 3 for 1 ms."""
    pacer_divisor: int = 47
    """N in 48 MHz/(N + 1); 47 for a nominal 1 MHz."""

    def __post_init__(self) -> None:
        pacer_words(self.pacer_divisor)
        _ = self.scan_entry
        super().__post_init__()

    @property
    def nominal_rate_hz(self) -> float:
        """The rate that the pacer's divisor asks for."""
        return pacer_rate_hz(self.pacer_divisor)

    @property
    def scan_entry(self) -> int:
        """The scan-list entry of the configured input."""
        return scan_entry(
            channel=self.channel,
            range_v=self.range_v,
            differential=self.differential,
            settling_code=self.settling_code,
        )
