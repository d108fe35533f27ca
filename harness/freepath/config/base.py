"""The base of every config model: no unknown keys, frozen, and messages in the author's words."""

import functools
from typing import Annotated, Any, ClassVar

from pydantic import (
    BaseModel,
    ConfigDict,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidatorFunctionWrapHandler,
    create_model,
    model_serializer,
    model_validator,
)
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from freepath.config.rules import Rule, describe, expected, failure, one_of, shown
from freepath.errors import did_you_mean

# each problem takes a search through the text, and nobody reads more
MOST_PROBLEMS = 100
# stands in an error's location for the step into {cloud: {...}}: it is no part of the path shown
INSIDE_KIND = ""
# the kinds of error whose caret belongs under a key instead of a value
UNKNOWN_KEY = "unknown_key"
UNKNOWN_KIND = "unknown_kind"


class Model(BaseModel):
    """A mapping with known keys. All of its errors read "expected ..., got ..."."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        protected_namespaces=(),
        use_attribute_docstrings=True,
    )

    @model_validator(mode="wrap")
    @classmethod
    def _explain(cls, data: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        try:
            return handler(data)
        except ValidationError as error:
            raise _relocated(error, (), cls) from None


def _relocated(
    error: ValidationError, prefix: tuple[str | int, ...], model: type[Model] | None
) -> ValidationError:
    lines = [
        InitErrorDetails(
            type=_explained(line, model), loc=prefix + line["loc"], input=line["input"]
        )
        for line in error.errors(include_url=False)[:MOST_PROBLEMS]
    ]
    return ValidationError.from_exception_data(error.title, lines)


def _explained(line: ErrorDetails, model: type[Model] | None) -> PydanticCustomError:
    """Return a line of pydantic's in the author's words; rules have chosen their words already."""
    name = line["loc"][-1] if line["loc"] else ""
    if line["type"] == "missing" and model:
        field = model.model_fields[str(name)]
        return expected(describe(field.annotation, field.metadata), None)
    if line["type"] == "extra_forbidden" and model:
        return failure("unknown key" + _known_keys(str(name), model), UNKNOWN_KEY)
    if line["type"] in ("model_type", "model_attributes_type") and model:
        return expected(_mapping(model), line["input"])
    return failure(line["msg"], line["type"])


def _mapping(model: type[Model]) -> str:
    fields = model.model_fields
    keys = list(fields)
    if issubclass(model, Kind):
        # what all media have is inherited and so comes first, but what must be given matters more
        keys.sort(key=lambda name: not fields[name].is_required())
    return f"a mapping with {', '.join(keys)}" if keys else "nothing more"


def _known_keys(name: str, model: type[Model]) -> str:
    near = did_you_mean(name, model.model_fields)
    if near:
        return near
    keys = one_of(model.model_fields) if model.model_fields else "none"
    return f"; expected {keys}"


class Kind(Model):
    """One kind of medium, majorant, tracker or rays with its parameters."""

    kind: ClassVar[str] = ""
    NEEDS: ClassVar[frozenset[str]] = frozenset()
    """What a tracker takes beside the extinction at a point; of other kinds nothing."""
    LATER: ClassVar[frozenset[str]] = frozenset()
    """Parameters that ids of cases that people have do not know: left out where they are usual."""

    @model_serializer(mode="wrap")
    def _as_written(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        fields = type(self).model_fields
        usual = {name for name in self.LATER if getattr(self, name) == fields[name].default}
        return {self.kind: {n: value for n, value in handler(self).items() if n not in usual}}

    def as_dict(self) -> dict[str, Any]:
        """Return {kind: {parameter: value}}, defaults filled in but those of LATER, for JSON."""
        return self.model_dump(mode="json")

    def parameters(self) -> dict[str, Any]:
        """Return the parameters and their values, defaults included, in their declared order."""
        return {name: getattr(self, name) for name in type(self).model_fields}

    def matches(self, pattern: "Pattern") -> bool:
        """Tell whether this is the pattern's kind and equals every parameter the pattern gives."""
        return self.kind == pattern.kind and all(
            getattr(self, name) == getattr(pattern, name) for name in pattern.model_fields_set
        )


class Pattern(Kind):
    """A kind of which only the parameters that must match are given."""

    @model_serializer(mode="wrap")
    def _as_written(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        values = handler(self)
        return {self.kind: {name: values[name] for name in values if name in self.model_fields_set}}


@functools.cache
def pattern_of(model: type[Kind]) -> type[Pattern]:
    """Return a model of the same kind whose parameters may all be left out, for exclude entries."""
    fields: dict[str, Any] = {
        name: (Annotated[(field.annotation, *field.metadata)], None)  # type: ignore[valid-type]
        if field.metadata
        else (field.annotation, None)
        for name, field in model.model_fields.items()
    }
    pattern = create_model(model.__name__, __base__=Pattern, __doc__=model.__doc__, **fields)
    pattern.kind = model.kind
    return pattern


class OneOf(Rule):
    """A kind, written as its bare name (all defaults) or as {name: {parameter: value}}.

    `models` maps names to models; None takes them from the validation's context under `word`.
    Where `pattern`, only the parameters that must match are given.
    """

    def __init__(
        self, word: str, models: dict[str, type[Kind]] | None = None, *, pattern: bool = False
    ):
        self.word = word
        self.models = models
        self.pattern = pattern

    def check(self, value: Any, context: Any) -> Kind:
        models = (context or {}).get(self.word, {}) if self.models is None else self.models
        name, parameters = self._split(value, models)
        model = pattern_of(models[name]) if self.pattern else models[name]
        try:
            return model.model_validate(parameters, context=context)
        except ValidationError as error:
            raise _relocated(error, (INSIDE_KIND,), None) from None

    def _split(self, value: Any, models: dict[str, type[Kind]]) -> tuple[str, Any]:
        name, parameters = value, None
        if isinstance(value, dict) and value:
            name, parameters = next(iter(value.items()))
            if len(value) > 1:
                raise self._several(value, models)
        if not isinstance(name, str):
            raise expected(self._describe(models), name)
        if name not in models:
            near = did_you_mean(name, models)
            what = self._noun if near else self._describe(models)
            raise failure(f"expected {what}, got {shown(name)}{near}", UNKNOWN_KIND)
        return name, {} if parameters is None else parameters

    def _several(self, value: dict[str, Any], models: dict[str, type[Kind]]) -> PydanticCustomError:
        first, second, *_ = value
        hint = ""
        if value[first] is None and first in models and second in models[first].model_fields:
            hint = f"; indent '{second}' deeper than '{first}' to make it a parameter"
        return failure(f"expected {self._noun} as a single key, got {len(value)} keys{hint}")

    @property
    def _noun(self) -> str:
        return self.word if self.word.endswith("s") else f"a {self.word}"

    def _describe(self, models: dict[str, type[Kind]] | None) -> str:
        return f"{self._noun} ({one_of(models)})" if models else self._noun

    def describe(self) -> str:
        return self._describe(self.models)

    @property
    def definition(self) -> str:
        """The name of this rule's definition in the JSON Schema."""
        return self.word + ("_pattern" if self.pattern else "")

    def json_schema(self) -> dict[str, Any]:
        # freepath.config.schema replaces this mark by a reference
        return {"kind_definition": self.definition}

    def definition_schema(self, models: dict[str, type[Kind]]) -> dict[str, Any]:
        """Return the JSON Schema of all kinds of `models`, in both forms."""
        if self.pattern:
            models = {name: pattern_of(model) for name, model in models.items()}
        schemas = {name: model.model_json_schema() for name, model in models.items()}
        bare = [name for name, schema in schemas.items() if "required" not in schema]
        mapping = {
            "type": "object",
            "properties": {
                name: {"anyOf": [schema, {"type": "null"}]} if name in bare else schema
                for name, schema in schemas.items()
            },
            "additionalProperties": False,
            "minProperties": 1,
            "maxProperties": 1,
        }
        return {"anyOf": [{"enum": bare}, mapping]} if bare else mapping
