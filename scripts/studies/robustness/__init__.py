"""Robustness: random problems of many families, an independent check, and the ablation."""
