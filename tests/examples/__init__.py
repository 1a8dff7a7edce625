"""The examples and case files run."""
