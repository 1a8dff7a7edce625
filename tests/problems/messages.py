"""Messages of input that is refused."""

from collections.abc import Callable
from typing import Any

import pytest

from contact.errors import InputError


def message_of(call: Callable[..., object], *given: Any, **named: Any) -> str:
    """Return the message of a call that is refused: one line, not too long."""
    with pytest.raises(InputError) as caught:
        call(*given, **named)
    message = str(caught.value)
    assert "\n" not in message and len(message) < 400
    return message
