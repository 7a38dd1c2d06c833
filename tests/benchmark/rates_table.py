"""Writes FOLDER/rates.md, one table for each Google Benchmark result FOLDER/*_benchmark.json.

    rates_table.py FOLDER [NAME]        NAME: also prints the tables of results whose name contains it
"""

import json
import sys
from pathlib import Path

# Members of a row that Google Benchmark makes itself; all others are counters of ours.
OWN = {"name", "family_index", "per_family_instance_index", "run_name", "run_type", "repetitions", "repetition_index",
       "threads", "iterations", "real_time", "cpu_time", "time_unit", "label", "aggregate_name", "aggregate_unit",
       "error_occurred", "error_message"}
SECONDS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}


def figure(value):
    """Three digits and a letter for thousands, millions ...: 12345678 -> 12.3 M."""
    for power, letter in ((1e12, " T"), (1e9, " G"), (1e6, " M"), (1e3, " k")):
        if abs(value) >= power:
            return f"{value / power:.3g}{letter}"
    return f"{value:.3g}"


def duration(seconds):
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def table(result):
    """Lines of Markdown. Time is wall-clock; processor time counts all threads where the benchmark says so."""
    lines = ["| benchmark | of | time | processor | counters |", "|---|---|---:|---:|---|"]
    for row in result["benchmarks"]:
        name = row["name"].replace("/process_time", "").replace("/real_time", "").replace("/iterations:1", "")
        if row.get("error_occurred"):
            lines.append(f"| {name} | failed: {row.get('error_message', '')} | | | |")
            continue
        unit = SECONDS[row.get("time_unit", "ns")]
        counters = ", ".join(f"{key} {figure(value)}" for key, value in row.items() if key not in OWN)
        lines.append(f"| {name} | {row.get('label', '')} | {duration(row['real_time'] * unit)} "
                     f"| {duration(row['cpu_time'] * unit)} | {counters} |")
    return lines


def main(folder, wanted=None):
    results = sorted(folder.glob("*_benchmark.json"))
    text = ["# Rates", ""]
    for path in results:
        try:
            result = json.loads(path.read_text())
            context = result["context"]
            load = ", ".join(f"{value:.1f}" for value in context.get("load_avg", []))
            section = [f"## {path.stem}", "", f"{context['num_cpus']} cores, load {load or 'unknown'} when it began.", "",
                       *table(result), ""]
            text += section
            if wanted and wanted in path.stem:
                print("\n".join(section))
        except (ValueError, KeyError) as error:
            text += [f"## {path.stem}", "", f"Not readable: {error!r}.", ""]  # a run that was cut short
    if results:
        (folder / "rates.md").write_text("\n".join(text))


if __name__ == "__main__":
    main(Path(sys.argv[1]), *sys.argv[2:3])
