"""The thesis's tables and figures, beside ours."""
