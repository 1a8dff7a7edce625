"""Static frictional contact of Hencky and piezoelectric bodies with FEniCSx."""
