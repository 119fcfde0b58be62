"""Companion: lands a PX4 multirotor on a pad that moves.

Read `messages.py` first: it is the vocabulary. `pipeline.py` is what happens to a message.
"""

__version__ = "0.1.0"
