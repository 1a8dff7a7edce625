"""Times, and another code on the same problems."""
