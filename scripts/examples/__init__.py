"""Examples to read first."""
