"""A trouble that lasts is said at once and then ever more rarely."""

from __future__ import annotations

from companion.trouble import Trouble

SECOND_NS = 10**9


def said_at_s(trouble: Trouble, seconds: range, text: str = "no camera") -> list[int]:
    return [s for s in seconds if trouble.is_worth_saying(s * SECOND_NS, text)]


def test_what_happens_each_second_is_said_with_doubling_pauses() -> None:
    assert said_at_s(Trouble(), range(600)) == [0, 10, 30, 70, 150, 270, 390, 510]


def test_another_text_is_said_at_once() -> None:
    trouble = Trouble()
    said_at_s(trouble, range(5))
    assert said_at_s(trouble, range(5, 8), "the stream ended") == [5]


def test_after_it_has_worked_again_the_same_is_news() -> None:
    trouble = Trouble()
    said_at_s(trouble, range(5))
    assert trouble.over()
    assert not trouble.over()
    assert said_at_s(trouble, range(5, 20)) == [5, 15]
