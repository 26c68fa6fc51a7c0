"""The formats of ``libero-max export``: a module for each."""
