"""Flights in lockstep with the simulator, one or hundreds: the only place where `companion` meets `sitl_stub`.

They meet through MAVLink bytes and images, in one process, with no socket and no sleep.
"""
