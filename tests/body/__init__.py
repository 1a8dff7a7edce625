"""Tests of one body."""
