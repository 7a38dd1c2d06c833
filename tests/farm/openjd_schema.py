"""The Open Job Description template schema 2023-09 (github.com/OpenJobDescription/openjd-specifications, wiki, "Template
Schemas") as far as a template without embedded files and environments needs it. What is not named here is refused, as
the specification asks."""
import re

IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,63}")
RANGE = re.compile(r"\s*-?\d+(\s*-\s*-?\d+(\s*:\s*-?\d+)?)?\s*(,\s*-?\d+(\s*-\s*-?\d+(\s*:\s*-?\d+)?)?\s*)*")
REFERENCE = re.compile(r"\{\{\s*([A-Za-z0-9_.]+)\s*\}\}")


class Invalid(Exception):
    """Names the place in the template."""


def expect(holds, place, what):
    if not holds:
        raise Invalid(f"{place}: {what}")


def members(value, place, required, optional=()):
    """An object with just these members."""
    expect(isinstance(value, dict), place, "must be an object")
    for key in required:
        expect(key in value, place, f"{key} is missing")
    for key in value:
        expect(key in required or key in optional, f"{place}.{key}", "is not in the schema")


def text(value, place, longest, shortest=1):
    expect(isinstance(value, str), place, "must be a string")
    expect(shortest <= len(value) <= longest, place, f"must have {shortest} to {longest} characters")
    expect(not re.search(r"[\x00-\x1f\x7f-\x9f]", value) or longest > 1024, place, "has control characters")


def entries(value, place, check, most, least=1):
    expect(isinstance(value, list), place, "must be a list")
    expect(least <= len(value) <= most, place, f"must have {least} to {most} elements")
    for i, entry in enumerate(value):
        check(entry, f"{place}[{i}]")
    return value


def unique_names(values, place):
    names = [value["name"] for value in values]
    expect(len(names) == len(set(names)), place, "names must be unique")


def number(value, place, kind):
    expect(isinstance(value, kind) and not isinstance(value, bool), place, "must be a number")


def parameter(value, place):
    common = {"STRING": ("allowedValues", "minLength", "maxLength"),
              "PATH": ("allowedValues", "minLength", "maxLength", "objectType", "dataFlow"),
              "INT": ("allowedValues", "minValue", "maxValue"), "FLOAT": ("allowedValues", "minValue", "maxValue")}
    expect(isinstance(value, dict) and value.get("type") in common, place, "type must be STRING, PATH, INT or FLOAT")
    kind = value["type"]
    members(value, place, ("name", "type"), ("description", "default", "userInterface", *common[kind]))
    expect(IDENTIFIER.fullmatch(value["name"]), place, "name must be an identifier")
    if "description" in value:
        text(value["description"], f"{place}.description", 2048)
    if kind == "PATH":
        expect(value.get("objectType", "DIRECTORY") in ("FILE", "DIRECTORY"), place, "objectType")
        expect(value.get("dataFlow", "NONE") in ("NONE", "IN", "OUT", "INOUT"), place, "dataFlow")
    for key in ("default", "minValue", "maxValue"):
        if key in value and kind in ("INT", "FLOAT"):
            number(value[key], f"{place}.{key}", int if kind == "INT" else (int, float))
    if kind in ("INT", "FLOAT") and "default" in value:
        expect(value.get("minValue", value["default"]) <= value["default"] <= value.get("maxValue", value["default"]),
               place, "the default must be within minValue and maxValue")
    if kind == "STRING" and "default" in value:
        text(value["default"], f"{place}.default", 1024, 0)


def amount(value, place):
    members(value, place, ("name",), ("min", "max"))
    expect(re.fullmatch(r"([a-z_][\w]*:)?amount\.(worker|job|step|task)\.\w[\w.]*|amount\.\w+", value["name"]), place, "name")
    expect("min" in value or "max" in value, place, "min or max is needed")
    for key in {"min", "max"} & set(value):
        number(value[key], f"{place}.{key}", (int, float))


def attribute(value, place):
    members(value, place, ("name",), ("anyOf", "allOf"))
    expect(value["name"].startswith("attr."), place, "name")
    expect("anyOf" in value or "allOf" in value, place, "anyOf or allOf is needed")
    if value["name"] == "attr.worker.os.family":
        expect(set(value.get("anyOf", [])) <= {"linux", "windows", "macos"}, place, "no such family")


def requirements(value, place):
    members(value, place, (), ("amounts", "attributes"))
    expect(value, place, "must not be empty")
    if "amounts" in value:
        unique_names(entries(value["amounts"], f"{place}.amounts", amount, 50), place)
    if "attributes" in value:
        unique_names(entries(value["attributes"], f"{place}.attributes", attribute, 50), place)


def task_parameter(value, place):
    members(value, place, ("name", "type", "range"))
    expect(IDENTIFIER.fullmatch(value["name"]), place, "name must be an identifier")
    expect(value["type"] in ("INT", "FLOAT", "STRING", "PATH"), place, "type")
    if isinstance(value["range"], str):
        expect(value["type"] == "INT", place, "only INT takes a range expression")
        expect(REFERENCE.search(value["range"]) or RANGE.fullmatch(value["range"]), place, "range")
    else:
        entries(value["range"], f"{place}.range", lambda *_: None, 1024)


def action(value, place):
    members(value, place, ("command",), ("args", "timeout", "cancelation"))
    text(value["command"], f"{place}.command", 1 << 15)
    if "args" in value:
        entries(value["args"], f"{place}.args", lambda v, p: text(v, p, 1 << 15, 0), 1 << 10)
    if "timeout" in value:
        number(value["timeout"], f"{place}.timeout", int)
        expect(value["timeout"] > 0, place, "timeout must be positive")
    if "cancelation" in value:
        cancel = value["cancelation"]
        members(cancel, f"{place}.cancelation", ("mode",), ("notifyPeriodInSeconds",))
        expect(cancel["mode"] in ("NOTIFY_THEN_TERMINATE", "TERMINATE"), place, "mode")
        if "notifyPeriodInSeconds" in cancel:
            expect(cancel["mode"] == "NOTIFY_THEN_TERMINATE" and 1 <= cancel["notifyPeriodInSeconds"] <= 600, place,
                   "notifyPeriodInSeconds must be 1 to 600")


def step(value, place):
    members(value, place, ("name", "script"), ("description", "hostRequirements", "parameterSpace", "dependencies"))
    text(value["name"], f"{place}.name", 64)
    if "hostRequirements" in value:
        requirements(value["hostRequirements"], f"{place}.hostRequirements")
    if "parameterSpace" in value:
        space = value["parameterSpace"]
        members(space, f"{place}.parameterSpace", ("taskParameterDefinitions",), ("combination",))
        unique_names(entries(space["taskParameterDefinitions"], f"{place}.parameterSpace", task_parameter, 16), place)
    members(value["script"], f"{place}.script", ("actions",))
    members(value["script"]["actions"], f"{place}.script.actions", ("onRun",))
    action(value["script"]["actions"]["onRun"], f"{place}.script.actions.onRun")


def references(value, place, known):
    """Every {{name}} must be known where it stands."""
    if isinstance(value, str):
        for name in REFERENCE.findall(value):
            expect(name in known, place, f"{{{{{name}}}}} is not defined here")
        expect(value.count("{{") == len(REFERENCE.findall(value)), place, "a reference that is not closed")
    elif isinstance(value, (list, dict)):
        for key, inner in value.items() if isinstance(value, dict) else enumerate(value):
            references(inner, f"{place}.{key}", known)


def check(template):
    members(template, "template", ("specificationVersion", "name", "steps"), ("description", "parameterDefinitions"))
    expect(template["specificationVersion"] == "jobtemplate-2023-09", "specificationVersion", "must be jobtemplate-2023-09")
    text(template["name"], "name", 128)
    parameters = entries(template.get("parameterDefinitions", []), "parameterDefinitions", parameter, 50, 0)
    unique_names(parameters, "parameterDefinitions")
    unique_names(entries(template["steps"], "steps", step, 100), "steps")
    # Paths are mapped on the host that runs a task, so before that only their raw text is known.
    early = {f"RawParam.{p['name']}" for p in parameters} | {f"Param.{p['name']}" for p in parameters if p["type"] != "PATH"}
    references(template["name"], "name", early)
    for one in template["steps"]:
        references(one.get("parameterSpace"), f"{one['name']}.parameterSpace", early)
        tasks = one.get("parameterSpace", {}).get("taskParameterDefinitions", [])
        known = early | {f"Param.{p['name']}" for p in parameters}
        known |= {f"{prefix}.{t['name']}" for t in tasks for prefix in ("Task.Param", "Task.RawParam")}
        references(one["script"], f"{one['name']}.script", known | {"Session.WorkingDirectory"})
