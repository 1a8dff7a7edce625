"""Figures of a solution: contact, deformed body, potential."""
