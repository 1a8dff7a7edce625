"""Tests of contact.mesh."""
