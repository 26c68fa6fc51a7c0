"""Serving a policy: an adapter becomes a server that many workers share."""
