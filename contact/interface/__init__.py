"""Gamma_3: the contact nodes and their jump, obstacles, layer, current, friction, and their laws.

Imports: `contact.body` and what that may import. Every law is stated once, node by node.
"""
