"""What others say, fit for one field of a table: one line of printable characters, not too long."""

import re

_TERMINAL_CODES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")


def one_line(text: str, limit: int = 500) -> str:
    """A text without line breaks, terminal codes, control characters and halves of characters.

    Args:
        text: Any text.
        limit: Most characters of the answer; what was cut off is marked by three dots.
    """
    plain = _TERMINAL_CODES.sub("", text[: 4 * limit])
    line = " ".join("".join(c if c.isprintable() else " " for c in plain).split())
    return line if len(line) <= limit and len(text) <= 4 * limit else f"{line[: limit - 4]} ..."
