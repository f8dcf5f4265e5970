"""Many messages of one shape at once: one is encoded properly, the others are copies of its bytes with values put in.

In CDR a message whose strings and arrays keep their lengths has every value at a fixed place. A place is found by
encoding the message with a mark for each value.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Bytes = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class MessageTemplate:
    """An encoded message and where its values stand."""

    data: Bytes
    """(L,) the encoded message."""
    offsets: tuple[int, ...]
    """Where each value begins."""


def find_values(data: bytes, marks: Sequence[bytes]) -> MessageTemplate:
    """Find the places of values in a message that was encoded with marks for them.

    Raises:
        ValueError: a mark does not stand in the message exactly once.
    """
    for mark in marks:
        if data.count(mark) != 1:
            raise ValueError(f"a mark must stand once in the message, got {data.count(mark)} times")
    return MessageTemplate(np.frombuffer(data, dtype=np.uint8), tuple(data.index(mark) for mark in marks))


def fill_template(template: MessageTemplate, values: Sequence[npt.NDArray[Any]]) -> list[bytes]:
    """Encode C messages.

    Args:
        template: The message, and where its values stand.
        values: For each place, (C,) or (C, K) values of the type that stands there, little endian.

    Returns:
        C encoded messages.
    """
    count = len(values[0])
    rows = np.tile(template.data, (count, 1))
    for offset, column in zip(template.offsets, values, strict=True):
        raw = np.ascontiguousarray(column).reshape(count, -1).view(np.uint8)
        rows[:, offset : offset + raw.shape[1]] = raw
    return [row.tobytes() for row in rows]
