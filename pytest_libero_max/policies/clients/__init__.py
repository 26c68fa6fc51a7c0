"""Policies behind servers: addresses, codecs, one module for each protocol, and the policy that speaks it."""
