"""When to say again that something does not work: at once, then after ever longer pauses. Used by the live shell."""

from __future__ import annotations

FIRST_PAUSE_NS = 10_000_000_000
LONGEST_PAUSE_NS = 120_000_000_000


class Trouble:
    """One condition. Another text is another trouble and is said at once."""

    def __init__(self) -> None:
        self._text: str | None = None
        self._due_ns = 0
        self._pause_ns = FIRST_PAUSE_NS

    def is_worth_saying(self, now_ns: int, text: str) -> bool:
        """Ask each time it happens."""
        if text != self._text:
            self._text, self._pause_ns = text, FIRST_PAUSE_NS
        elif now_ns < self._due_ns:
            return False
        self._due_ns = now_ns + self._pause_ns
        self._pause_ns = min(2 * self._pause_ns, LONGEST_PAUSE_NS)
        return True

    def over(self) -> bool:
        """It works again: the next time is a first time. True where there was trouble."""
        there_was = self._text is not None
        self._text = None
        return there_was
