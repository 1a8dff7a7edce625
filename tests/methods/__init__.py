"""Tests of contact.methods."""
