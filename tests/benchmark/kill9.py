"""kill9.py [--kills N] [--output DIR]: kills a server under a load of edits N times (SIGKILL, at random moments) and
counts what was acknowledged, what of it was lost, and how long the server took to be ready again. Before that: how long
an edit of a lamp takes to be acknowledged, with and without --state, thirty times a second as a drag sends them.
Environment as for the service tests: RADIOSITYD. Writes kill9.md and kill9.json. Exits with 1 where anything was lost."""
import argparse
import asyncio
import json
import pathlib
import random
import shutil
import sys
import tempfile
import time
import uuid

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "service" / "programs"))

import plates  # noqa: E402
from edit_load import STRENGTH, Ledger, load_for, ready_seconds, scene_with_counters  # noqa: E402
from harness import Server  # noqa: E402
from wire import Session  # noqa: E402

SETTINGS = ("--texels", 500, "--error", 0.05)
DRAG_SECONDS, DRAG_HZ = 10.0, 30.0


def percentiles(values, scale=1000.0):
    ordered = sorted(values)
    def at(part):
        return round(ordered[min(len(ordered) - 1, int(part * len(ordered)))] * scale, 2) if ordered else None
    return {"p50": at(0.5), "p90": at(0.9), "p99": at(0.99), "max": at(1.0)}


async def drag(url):
    """Acknowledgement times of a lamp that is dimmed up and down, while the solve runs."""
    session = await Session.open(url)
    await session.call("solve.wait", timeoutMs=60000)
    times, end = [], time.monotonic() + DRAG_SECONDS
    while (begun := time.monotonic()) < end:
        patch = [{"op": "replace", "path": STRENGTH, "value": 5 + len(times) % 50}]
        await session.call("scene.patch", patch=patch)
        times.append(time.monotonic() - begun)
        await asyncio.sleep(max(0.0, 1 / DRAG_HZ - times[-1]))
    await session.close()
    return times


def measure_drag(folder, scene, *arguments):
    server = Server(folder, scene, *arguments, mark=uuid.uuid4().hex)
    try:
        return percentiles(asyncio.run(drag(server.url)))
    finally:
        server.terminate()


def kill_often(folder, scene, kills):
    ledger, dice, ready, lost = Ledger(), random.Random(9), [], 0
    for kill in range(kills + 1):
        started = time.monotonic()
        server = Server(folder, scene, "--state", folder / "state", *SETTINGS, mark=uuid.uuid4().hex)
        try:
            ready.append(ready_seconds(server.url, started))
            lost += asyncio.run(asyncio.wait_for(ledger.check(server.url), 60))
            if kill < kills:
                asyncio.run(asyncio.wait_for(
                    load_for(ledger, server.url, dice.uniform(0.0, 0.4), server.process.kill), 60))
        finally:
            server.kill()
            server.log_path.unlink()
        if kill % 50 == 0:
            print(f"{kill} kills, {ledger.total} edits acknowledged, {lost} lost", file=sys.stderr, flush=True)
    return {"kills": kills, "acknowledged": ledger.total, "lost": lost, "ready_ms": percentiles(ready),
            "acknowledge_ms_four_writers": percentiles(ledger.latencies)}


def markdown(result):
    drags, kills = result["drag_ms"], result["kill9"]
    rows = ["| edit of a lamp acknowledged, 30 a second | p50 ms | p90 ms | p99 ms | max ms |", "|---|---|---|---|---|"]
    for name, values in {**drags, "four writers as fast as they can, killed": kills["acknowledge_ms_four_writers"]}.items():
        rows.append(f"| {name} | " + " | ".join(str(values[p]) for p in ("p50", "p90", "p99", "max")) + " |")
    ready = kills["ready_ms"]
    rows += ["", "| kill -9 | acknowledged | lost | ready again, p50 ms | p99 ms | max ms |", "|---|---|---|---|---|---|",
             f"| {kills['kills']} | {kills['acknowledged']} | {kills['lost']} | {ready['p50']} | {ready['p99']} | "
             f"{ready['max']} |"]
    return "\n".join(rows) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=1000)
    parser.add_argument("--output", type=pathlib.Path, default=ROOT / "out" / "bench")
    options = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="radiosity-kill9-"))
    try:
        scene = folder / "plates.glb"
        plates.write_glb(scene, scene_with_counters())
        drags = {"in memory": measure_drag(folder, scene, *SETTINGS),
                 "durable (--state)": measure_drag(folder, scene, *SETTINGS, "--state", folder / "drag")}
        result = {"drag_ms": drags, "kill9": kill_often(folder, scene, options.kills)}
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "kill9.json").write_text(json.dumps(result, indent=1) + "\n")
    (options.output / "kill9.md").write_text(markdown(result))
    print(markdown(result))
    return 1 if result["kill9"]["lost"] else 0


if __name__ == "__main__":
    sys.exit(main())
