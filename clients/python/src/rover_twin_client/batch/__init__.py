"""Many scenarios as columns: what is sent, how answers are read, and what callers get."""
