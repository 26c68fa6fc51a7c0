"""Substrates: each builds worlds, and has its catalogue of source variations."""
