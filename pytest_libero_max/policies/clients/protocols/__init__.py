"""The protocols that are spoken, a module for each scheme of an address."""
