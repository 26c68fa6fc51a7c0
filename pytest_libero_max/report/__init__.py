"""The report of a run: everything that is computed from its records."""
