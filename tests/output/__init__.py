"""Tests of contact.output."""
