"""The simulator's own MAVLink: framing, message layouts and signing, made for speed (one precompiled struct a message)."""
