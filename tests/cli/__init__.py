"""Tests of contact.cli."""
