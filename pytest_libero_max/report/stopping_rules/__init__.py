"""Stopping rules that ship with the package, one file each, called like the rule."""
