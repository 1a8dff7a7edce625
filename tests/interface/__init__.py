"""Tests of contact.interface."""
