"""Tests of contact.linear."""
