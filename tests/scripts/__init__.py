"""Tests of the scripts and the launcher."""
