"""model.json: the effects that a model has, with their parameters; and libraries of effects, built in or a user's own file.

    {"format": "active-stereo-model", "version": 1, "effects": [{"id": ..., "parameters": {...}}], "nuisances": {...}}
"""

import json
from pathlib import Path

from activestereo.effects import Model, builtin, load_effects
from activestereo.output_files import replace_file

FORMAT = "active-stereo-model"
VERSION = 1


def library(*files):
    """The built-in effects and those of files, by id; a file's effect replaces a built-in one of the same id."""
    effects = builtin()
    for file in files:
        effects |= load_effects(file)
    return effects


def read_model(path, effects):
    """A Model from a file, or the empty one for None. ValueError says what is wrong and where."""
    if path is None:
        return Model()
    try:
        root = json.loads(Path(path).read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise ValueError(f"{path}: not JSON: {error}") from error
    if not isinstance(root, dict) or root.get("format") != FORMAT or root.get("version") != VERSION:
        raise ValueError(f"{path}: format is not {FORMAT!r} version {VERSION}")
    model = Model()
    try:
        for entry in root.get("effects", []):
            model = model.with_effect(find(effects, entry["id"]), **entry.get("parameters", {}))
    except (KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"{path}: effects is not a list of {{id, parameters}} with numbers: {error!r}") from error
    return model


def find(effects, effect_id):
    """The effect of an id; ValueError lists what there is."""
    if effect_id not in effects:
        raise ValueError(f"no effect '{effect_id}' (there are: {', '.join(effects)})")
    return effects[effect_id]


def model_json(model, nuisances=None):
    effects = [{"id": e.id, "parameters": dict(values)} for e, values in model.effects]
    return {"format": FORMAT, "version": VERSION, "effects": effects, "nuisances": vars(nuisances) if nuisances else {}}


def write_model(path, model, nuisances=None):
    text = json.dumps(model_json(model, nuisances), indent=1) + "\n"
    replace_file(path, lambda file: file.write(text.encode()))


def added_from(diagnosis, effect_id):
    """{parameter: value} that a diagnose.json found for an effect: as accepted, else as ranked."""
    entries = [*diagnosis.get("model", {}).get("effects", []), *diagnosis.get("ranking", [])]
    for entry in entries:
        if entry.get("id", entry.get("effect")) == effect_id:
            values = entry["parameters"]
            return {name: v["value"] if isinstance(v, dict) else v for name, v in values.items()}
    raise ValueError(f"the diagnosis has no parameters of '{effect_id}'")
