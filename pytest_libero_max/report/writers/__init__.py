"""Writers of a report: terminal, Markdown, JUnit, CSV, LaTeX, figures."""
