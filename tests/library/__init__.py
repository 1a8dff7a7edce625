"""Tests of `contact.library`."""
