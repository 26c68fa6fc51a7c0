"""Measurements of our speed beside that of robosuite and the packages."""
