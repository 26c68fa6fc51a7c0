"""How long pairs take: what was measured, what is expected of the others, and how long a fleet plays them."""
