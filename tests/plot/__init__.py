"""Tests of contact.plot."""
