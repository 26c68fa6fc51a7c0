"""Scripted policies that ship with the package; the expert is the instrument of certificates."""
