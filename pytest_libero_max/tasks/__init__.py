"""Tasks: LIBERO's forty, and what their scenes contain."""
