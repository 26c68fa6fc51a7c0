"""Costs of pairs: measured, expected of other pairs, and the time that a fleet needs for them."""
