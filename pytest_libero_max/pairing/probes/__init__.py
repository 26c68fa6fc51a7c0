"""Probes: read-only measurements of every arm while it is played. One file each."""
