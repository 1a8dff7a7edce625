"""Tests of contact.io."""
