"""Python's values in words, for errors: a short beginning of each, however long it is and whatever its `repr` does."""

from __future__ import annotations

import reprlib
from typing import Any

#: Characters of an exception's words that are said at most; the exception itself is the cause of what says them.
LONGEST_SAID = 1000

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = 200
_SHORT.maxlevel = 3


def shown(value: Any) -> str:
    """What a value is, in a line."""
    return " ".join(_SHORT.repr(value).split())


def named(name: Any) -> str:
    """A name as it is, if it is one that a terminal can show."""
    return name if isinstance(name, str) and 0 < len(name) <= 256 and name.isprintable() else shown(name)


def said(failure: BaseException) -> str:
    """What an exception says, which may be long, no text for a terminal, or nothing because that fails in turn."""
    try:
        words = str(failure)
    except Exception:
        return "(its words cannot be had)"
    words = words if len(words) <= LONGEST_SAID else f"{words[:LONGEST_SAID]}…"
    return words.encode(errors="backslashreplace").decode()
