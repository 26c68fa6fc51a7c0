"""The parts of a report that are about a study, and their tables and figures."""
