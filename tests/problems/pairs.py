"""Two blocks on each other, as the tables of a case."""


def case(**more):
    """Return the tables, some of them replaced."""
    return {
        "mesh": {"generator": "two_blocks", "lower_size": 0.3, "upper_size": 0.3},
        "material": {"young": 100.0, "poisson": 0.3},
        "fixed": [{"on": "lower_bottom", "displacement": [0.0, 0.0]}],
        "load": [{"on": "upper_top", "traction": [0.0, -1.0]}],
        "contact": {"on": "upper_bottom", "against": "lower_top"},
        "friction": {"law": "coulomb", "mu": 0.3},
        **more,
    }
