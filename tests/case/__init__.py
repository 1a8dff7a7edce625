"""Tests of contact.case."""
