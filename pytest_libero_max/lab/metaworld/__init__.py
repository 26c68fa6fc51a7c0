"""Meta-World: its fifty tasks, its Sawyer and its scripted policies, from the package ``metaworld``."""
