"""Mission: which phase, and what the vehicle is asked for in it.

`phases.py` is the table, `guards.py` the named conditions, `machine.py` one step of it, `touchdown.py` the evidence that
the vehicle stands on the pad, `search.py` the patterns. The autopilot's landed state is never trusted on a moving deck.
"""
