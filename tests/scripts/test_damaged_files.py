"""Files that are damaged end in one message, or a restart; nothing is removed."""

import pytest

from scripts.studies import damaged_files as study


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return study.templates(tmp_path_factory.mktemp("damaged"))


#: Arrays that are missing or others in a checkpoint with a right checksum (23, 27, 86, 89), and the
#: first ones of all commands.
@pytest.mark.parametrize("number", [0, 1, 2, 3, 4, 5, 23, 27, 86, 89])
def test_damaged_files_end_in_a_message(number, made, tmp_path):
    words, status, wrong, said = study.tried(number, made, tmp_path)
    assert not wrong, f"{words}: {status}, {wrong}: {said}"
