"""Every key described, methods with their options, the page on the case file."""

import tomllib

import pytest

from contact.case.file import Case, parse_case, to_toml
from contact.methods.options import OPTIONS, NewtonOptions, with_method
from contact.model.messages import keys_of, sections_of
from scripts import case_page
from tests.problems.bar import changed


def test_every_key_is_described():
    sections = [Case]
    for section in sections:
        for key, field in keys_of(section).items():
            assert field.description, f"{section.__name__}.{key}"
            sections += sections_of(field.annotation).values()
    assert len(set(sections)) > 25  # all were found


@pytest.mark.parametrize("method", OPTIONS)
def test_the_settings_of_a_method_are_its_options(method):
    solver = parse_case(changed(solver={"method": method})).solver
    assert solver == OPTIONS[method]()
    given = OPTIONS[method](tolerance=1e-12)
    assert parse_case(changed(solver=given)).solver is given
    assert with_method(given, NewtonOptions) == NewtonOptions(tolerance=1e-12)


def test_the_resolved_case_holds_what_the_method_reads():
    keys = "method", "tolerance", "max_outer", "linear"
    table = tomllib.loads(to_toml(parse_case(changed())))["solver"]
    assert tuple(table) == keys
    table = tomllib.loads(to_toml(parse_case(changed(solver={"method": "penalty"}))))["solver"]
    assert tuple(table) == (*keys, "stopping", "max_inner", "material_step")


def test_the_reference_page_is_up_to_date():
    assert case_page.PAGE.read_text() == case_page.page(), "run python3 -m scripts.case_page"
