"""Recovery: runs of one policy with and without restoration of its images."""
