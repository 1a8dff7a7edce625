"""Tests of contact.results."""
