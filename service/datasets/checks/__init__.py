"""Which runs can be used: the checks of values, times and motion, and between runs."""
