"""Tests of contact.problem."""
