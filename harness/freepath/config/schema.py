"""The JSON Schema of configs, for editors; made from the models that validate them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from freepath.config.axes import TRACKER
from freepath.config.base import Kind, OneOf
from freepath.config.lights import LIGHTS
from freepath.config.models import MAJORANTS, MEDIA
from freepath.config.rays import RAYS
from freepath.config.sweep import Config

DIALECT = "https://json-schema.org/draft/2020-12/schema"


def json_schema(trackers: Mapping[str, type[Kind]]) -> dict[str, Any]:
    """Return the schema of configs that may use these trackers (parameter models by name)."""
    kinds = {"medium": MEDIA, "majorant": MAJORANTS, "light": LIGHTS, "rays": RAYS}
    kinds[TRACKER] = dict(trackers)
    schema = Config.model_json_schema()
    definitions = schema.pop("$defs", {})
    for word, models in kinds.items():
        for pattern in (False, True):
            rule = OneOf(word, pattern=pattern)
            definitions[rule.definition] = rule.definition_schema(models)
    used = {name: _linked(definition) for name, definition in definitions.items()}
    used.pop("rays_pattern")  # rays are no axis, so no exclude entry names them
    return {"$schema": DIALECT, **_linked(schema), "title": "freepath config", "$defs": used}


def text(trackers: Mapping[str, type[Kind]]) -> str:
    """The same as JSON."""
    return json.dumps(json_schema(trackers), indent=1, ensure_ascii=False) + "\n"


def _linked(schema: Any) -> Any:
    """Replace the marks that OneOf leaves, and drop titles and defaults that say nothing."""
    if isinstance(schema, list):
        return [_linked(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    linked = {
        key: _linked(value)
        for key, value in schema.items()
        if not (key == "title" and isinstance(value, str))
        and not (key == "default" and value is None)
        and key != "kind_definition"
    }
    if len(linked.get("allOf", ())) == 1:
        # how pydantic before 2.9 writes a reference that has a description
        linked |= linked.pop("allOf")[0]
    if "kind_definition" in schema:
        linked["$ref"] = f"#/$defs/{schema['kind_definition']}"
    return linked
