"""The same results on any number of ranks."""
