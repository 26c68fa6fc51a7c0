"""A run on disk: its plan, its records, its lock, its provenance, and checks of agreement."""
