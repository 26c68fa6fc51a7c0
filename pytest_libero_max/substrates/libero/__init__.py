"""The genuine substrate: scenes of an installed LIBERO, LIBERO-Plus or LIBERO-PRO, driven by our own loop."""
