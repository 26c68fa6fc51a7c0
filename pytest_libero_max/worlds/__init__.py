"""Worlds: the scenes in which episodes are played, behind one contract."""
