"""Pages that people explore: one file each, whose script needs no network, no framework and no build."""
