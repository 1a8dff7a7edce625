"""Parts of the boundary in the case file: a name, or a list of names."""

from __future__ import annotations

from typing import Annotated, Any, TypeAlias

from pydantic_core import PydanticCustomError, core_schema

from contact.errors import InputError
from contact.mesh import together
from contact.settings import Accepted


class _PartSchema:
    """Lets pydantic read a name or a list of names as the name of a part, or of several."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(
            _part,
            serialization=core_schema.plain_serializer_function_ser_schema(_listed),
        )


def _part(given: Any) -> str:
    try:
        return together.part(given)
    except InputError:
        raise PydanticCustomError("part", "part") from None


def _listed(name: str) -> str | list[str]:
    return list(name.members) if isinstance(name, together.Together) else name


Part: TypeAlias = Annotated[str, _PartSchema, Accepted(together.ACCEPTED)]
