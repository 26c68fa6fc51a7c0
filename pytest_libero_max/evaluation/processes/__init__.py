"""Processes that play pairs: their limits, their crash logs, their deaths."""
