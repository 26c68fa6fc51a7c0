"""Rules for policies: adapters, built-in policies, and policies behind servers.

No episode is played. A policy is shown a few observations, as the pair runner would show them, and its
answers are compared with what it declares.
"""
