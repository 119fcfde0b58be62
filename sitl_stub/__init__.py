"""A stand-in for PX4 SITL: vehicle, autopilot, pad carrier, cameras and the wire, in plain Python. Shares no code with `companion`."""
