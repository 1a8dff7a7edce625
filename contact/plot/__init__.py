"""Figures of a solution, from its files (contact, body, potential), and of the set-up of a case."""
