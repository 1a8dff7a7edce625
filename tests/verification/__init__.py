"""Solutions against closed forms, manufactured solutions and published values."""
