"""Examples, the thesis's tables and figures, studies and benchmarks: `make NAME`."""
