"""The algebra of changes: small frozen values that alter a world, whenever they are applied."""
