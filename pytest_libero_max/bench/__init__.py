"""Measurements of our own speed, side by side with what they are compared to."""
