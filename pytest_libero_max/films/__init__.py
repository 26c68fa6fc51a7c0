"""Films of recorded pairs: the recorded actions played again, drawn, and written as a file."""
