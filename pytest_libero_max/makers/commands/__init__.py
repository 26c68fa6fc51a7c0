"""The commands of ``libero-max dev``: a module for each, called like it."""
