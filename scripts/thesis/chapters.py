"""Which script makes which tables and figures, in the order of the results page."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Part:
    """A script."""

    #: Its name, and that of the folder that it writes into.
    script: str
    #: On the results page.
    heading: str
    #: Name of the page, one of `PAGES`.
    page: str = "thesis-studies"


#: Name of a page of results -> its title.
PAGES = {
    "thesis-mechanics": "Chapters 3, 4 and 7: elasto-plastic bodies",
    "thesis-piezo": "Chapters 5 and 8: electro-elasto-plastic bodies",
    "thesis-compliance": "Chapters 6 and 8: compliant and conductive foundations",
    "thesis-studies": "Studies beside the thesis",
}

PARTS = (
    Part(
        "setups",
        "Set-ups and constants: Figures 1.1, 1.2, 7.1, 7.3, 8.1, 8.8, Table 8.1",
        "thesis-mechanics",
    ),
    Part("hertz", "Example 7.1: Hertz's cylinder, and a sphere", "thesis-mechanics"),
    Part("table_7_1", "Example 7.2: Table 7.1, Algorithms 1 and 2", "thesis-mechanics"),
    Part("figures_mechanics", "Example 7.2: Figures 7.4, 7.5, 7.7 and 7.8", "thesis-mechanics"),
    Part(
        "table_7_2",
        "Example 7.2: Table 7.2, the penalty method, Theorem 4.2",
        "thesis-mechanics",
    ),
    Part("convergence_mechanics", "Figure 7.6 and Theorems 3.2, 4.3 and 4.5", "thesis-mechanics"),
    Part("corner", "The singular corner of Example 7.2", "thesis-mechanics"),
    Part("curved_foundations", "Curved foundations"),
    Part("pressure_on_axis", "Pressure on the axis"),
    Part("nonlocal_friction", "Non-local friction at work"),
    Part("tables_piezo", "Examples 8.1 and 8.2: Tables 8.2 and 8.3", "thesis-piezo"),
    Part("figures_piezo", "Examples 8.1 and 8.2: Figures 8.2 to 8.7", "thesis-piezo"),
    Part("tables_compliance", "Examples 8.3 and 8.4: Table 8.4", "thesis-compliance"),
    Part("stopping_8_3", "Example 8.3: the thesis's two iterations", "thesis-compliance"),
    Part("figures_compliance", "Examples 8.3 and 8.4: figures", "thesis-compliance"),
    Part(
        "limit_theorem",
        "Theorems 6.3 to 6.5: limits of the compliant foundation",
        "thesis-compliance",
    ),
    Part("refinement_8", "Chapter 8 on finer meshes"),
    Part("sensitivity", "Parameters that the thesis does not print"),
    Part("agreement", "Agreement of the methods"),
)
