"""Probes: what is read of every arm while it is played, without touching it. One file each."""
