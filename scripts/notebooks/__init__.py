"""Notebooks (jupytext): open them in Jupyter, run them as scripts, or read them in the docs."""
