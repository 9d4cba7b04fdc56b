"""OpenAPI models of the structures that the whole project shares, described by their own docstrings."""

import ast
import inspect
import textwrap
from functools import cache
from types import GenericAlias, UnionType
from typing import Any, get_args, get_origin

import msgspec
from pydantic import BaseModel, ConfigDict, Field, create_model


@cache
def model_of(struct: type[msgspec.Struct]) -> type[BaseModel]:
    """Return a model with the fields, types and descriptions of a msgspec structure.

    The structure stays the only place where they are written down; the API encodes the structure itself
    and uses the model for its description.
    """
    descriptions = _attribute_docstrings(struct)
    fields: dict[str, Any] = {
        _attribute(field.name): (
            _translate(field.type),
            Field(alias=field.name, description=descriptions.get(field.name)),
        )
        for field in msgspec.structs.fields(struct)
    }
    config = ConfigDict(extra="forbid")
    return create_model(struct.__name__, __doc__=inspect.getdoc(struct), __config__=config, **fields)


def _attribute(name: str) -> str:
    """Return the name of a model's attribute: a name that models have themselves (`schema`) gets a mark."""
    return f"{name}_" if hasattr(BaseModel, name) else name


def _translate(annotation: Any) -> Any:  # noqa: ANN401 - annotations have no common type
    """Replace structures inside a type annotation by their models."""
    if isinstance(annotation, type) and issubclass(annotation, msgspec.Struct):
        return model_of(annotation)
    if isinstance(annotation, GenericAlias):
        arguments = tuple(_translate(argument) for argument in get_args(annotation))
        return GenericAlias(get_origin(annotation), arguments)
    if isinstance(annotation, UnionType):
        first, *rest = (_translate(argument) for argument in get_args(annotation))
        for argument in rest:
            first = first | argument
        return first
    return annotation


def _attribute_docstrings(struct: type) -> dict[str, str]:
    """Return the strings that stand below the fields in the source of a class."""
    (definition,) = ast.parse(textwrap.dedent(inspect.getsource(struct))).body
    assert isinstance(definition, ast.ClassDef)
    found = {}
    for field, following in zip(definition.body, definition.body[1:], strict=False):
        match field, following:
            case (
                ast.AnnAssign(target=ast.Name(id=name)),
                ast.Expr(value=ast.Constant(value=str(text))),
            ):
                found[name] = inspect.cleandoc(text)
    return found
