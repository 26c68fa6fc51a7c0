"""Pictures of a world: the GL library, the device, the renderer, contact sheets."""
