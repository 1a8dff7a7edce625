"""Tests of contact.body."""
