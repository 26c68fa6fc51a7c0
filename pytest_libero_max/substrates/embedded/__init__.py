"""The embedded substrate: LIBERO's forty tasks in scenes that ship with the package."""
