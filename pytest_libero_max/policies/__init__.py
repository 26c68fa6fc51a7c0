"""Policies: the contract, loading an adapter, wrappers."""
