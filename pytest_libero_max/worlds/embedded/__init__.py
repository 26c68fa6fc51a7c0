"""The embedded substrate: twenty LIBERO tasks in scenes that ship with the package."""
