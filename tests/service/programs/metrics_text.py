"""A strict reader of the Prometheus text format 0.0.4 (prometheus.io/docs/instrumenting/exposition_formats), which also
holds to the naming rules that `promtool check metrics` asks for."""
import math
import re

NAME = r"[a-zA-Z_:][a-zA-Z0-9_:]*"
LABEL = r'([a-zA-Z_][a-zA-Z0-9_]*)="((?:[^"\\\n]|\\["\\n])*)"'
SAMPLE = re.compile(rf"({NAME})(?:\{{({LABEL}(?:,{LABEL})*)\}})? (\S+)")
TYPES = ("counter", "gauge", "untyped", "summary", "histogram")
UNITS_NOT_BASE = ("milliseconds", "ms", "kilobytes", "megabytes", "kib", "mib", "percent", "minutes", "hours")


class Family:
    def __init__(self, kind):
        self.kind, self.samples = kind, {}


def parse(text):
    """Families by name; raises ValueError, naming the line, for what a scraper would refuse or promtool warn of."""
    if not text.endswith("\n"):
        raise ValueError("the last line must end in a line feed")
    families, helps, ended, current = {}, set(), set(), None
    for number, line in enumerate(text[:-1].split("\n"), 1):
        def refuse(why):
            raise ValueError(f"line {number}: {why}: {line}")

        found = re.fullmatch(rf"# (HELP|TYPE) ({NAME}) (.+)", line)
        if found:
            what, name, rest = found.groups()
            if what == "HELP":
                if name in helps:
                    refuse("a second HELP")
                helps.add(name)
                continue
            if name in families or rest not in TYPES or name not in helps:
                refuse("TYPE must come once, after HELP, and be one of the types")
            if current is not None:
                ended.add(current)
            current, families[name] = name, Family(rest)
            if (rest == "counter") != name.endswith("_total"):
                refuse("counters, and only they, end in _total")
            if name != name.lower():
                refuse("not snake_case")
            if set(name.split("_")) & set(UNITS_NOT_BASE):
                refuse("not a base unit")
            continue
        found = SAMPLE.fullmatch(line)
        if not found:
            refuse("neither HELP, TYPE nor a sample")
        name, labels, value = found.group(1), found.group(2), found.groups()[-1]
        if name != current or name in ended:
            refuse("a sample away from its TYPE")
        pairs = tuple(re.findall(LABEL, labels)) if labels else ()
        if len({key for key, _ in pairs}) != len(pairs):
            refuse("a label twice")
        if pairs in families[name].samples:
            refuse("the same sample twice")
        number_read = float(value.replace("Inf", "inf"))
        if families[name].kind == "counter" and (math.isnan(number_read) or number_read < 0):
            refuse("a counter must be 0 or more")
        families[name].samples[pairs] = number_read
    return families
