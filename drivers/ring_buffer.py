"""A preallocated ring of samples: one thread writes, any thread copies out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.errors import ConfigurationError, RecordError


class RingBuffer:
    """The last samples of a stream, addressed by their position in the stream.

    Positions count from 0 at the start of the stream and never wrap; only the memory does. One
    writer, no lock: a copy is valid if its samples were still inside the ring after it was made,
    which `copy` checks. A capacity that is not positive is a ConfigurationError.
    """

    def __init__(self, capacity_samples: int) -> None:
        if capacity_samples <= 0:
            raise ConfigurationError(
                f"A ring buffer of {capacity_samples} samples cannot hold a record.",
                remedy="Raise ring_seconds in the digitizer section of the settings.",
            )
        self._memory: NDArray[np.uint16] = np.zeros(capacity_samples, dtype=np.uint16)
        self._claimed = 0
        self._written = 0

    @property
    def capacity_samples(self) -> int:
        """Samples the ring can hold. [1]"""
        return self._memory.size

    @property
    def written(self) -> int:
        """Samples appended since the last `clear`. [1]"""
        return self._written

    @property
    def oldest(self) -> int:
        """Position of the oldest sample still held. [1]"""
        return max(0, self._claimed - self._memory.size)

    def clear(self) -> None:
        """Forget everything and count from zero again."""
        self._claimed = 0
        self._written = 0

    def append(self, block: NDArray[np.uint16]) -> int:
        """Append a block and return the position of its first sample in the stream.

        Only its last `capacity_samples` samples can survive.
        """
        first = self._written
        capacity = self._memory.size
        # Claim before writing: a reader that copies meanwhile sees that its samples are going.
        self._claimed = first + block.size
        kept = block[-capacity:] if block.size > capacity else block
        start = (first + block.size - kept.size) % capacity
        head = min(kept.size, capacity - start)
        self._memory[start : start + head] = kept[:head]
        self._memory[: kept.size - head] = kept[head:]
        self._written = first + block.size
        return first

    def copy(self, first: int, count: int) -> NDArray[np.uint16]:
        """Return a copy of samples ``[first, first + count)`` that later writing cannot change.

        A RecordError says that some of them were not written yet or are overwritten already.
        """
        if first < 0 or count < 0 or first + count > self._written:
            raise RecordError(
                f"Samples {first} to {first + count} were asked for, "
                f"the stream has {self._written}.",
            )
        samples = np.empty(count, dtype=np.uint16)
        capacity = self._memory.size
        start = first % capacity
        head = min(count, capacity - start)
        samples[:head] = self._memory[start : start + head]
        samples[head:] = self._memory[: max(0, count - head)]
        if first < self.oldest:
            raise RecordError(
                f"Samples {first} to {first + count} are overwritten: "
                f"the ring begins at {self.oldest}.",
                why=f"The ring holds {capacity} samples and was read too late.",
                remedy="Raise ring_seconds in the digitizer section of the settings.",
            )
        return samples
