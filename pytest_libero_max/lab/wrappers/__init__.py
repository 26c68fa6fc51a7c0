"""Wrappers around any policy: restoration of its images, and early queries where the scene has changed."""
