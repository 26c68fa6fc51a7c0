"""A run on disk: its plan, its records, its lock, where it comes from, and what has to agree."""
