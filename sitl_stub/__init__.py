"""sitl_stub."""
