"""Renderers: a table, or a whole document, as text of the terminal, Markdown, CSV and LaTeX."""
