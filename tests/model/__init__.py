"""Tests of contact.model."""
