"""Processes that play pairs: time limits, memory limits, crash logs, isolation, retries."""
