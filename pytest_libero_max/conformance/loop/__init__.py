"""Rules for evaluation loops: a spy environment and a spy policy keep what a loop does with them."""
