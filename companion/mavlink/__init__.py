"""The companion's side of the wire, without input or output: bytes and time in, messages and bytes out.

session is the door; the other files each do one thing for it. dialect holds the messages used, codec turns frames into
them and back, framing finds frames in bytes.
"""
