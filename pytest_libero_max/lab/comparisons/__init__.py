"""The ways of ``libero-max compare`` that only some need: a module for each option, and what it computes."""
