"""soak.py [--edits N] [--connections N] [--state] [--output DIR]: a server's long life in short: so many edits of light
and geometry by four writers, and so many connections of viewers that watch, stall, resume, talk nonsense or vanish, and
of HTTP, in 20 rounds. After each round everybody leaves, the server comes to rest, and the memory, descriptors and
threads of all its processes are noted. Writes soak.md and soak.json.

Exits with 1 where an edit was lost or made twice, or something grew after the first five rounds, in which caches and
the allocator's pools fill up:
  memory (anonymous and shared, of each process, less the server's cache of tiles, which stops at 64 MiB): by more than
      16 MiB, median of the last three rounds over that of the
      three after the warm-up. What the allocator can hand out is 32 bytes at least, so that something forgotten in every
      one of 10^6 edits would be 22 MiB; a session or a request forgotten takes a kilobyte and more, so that one in six of
      10^5 connections would be seen.
  descriptors and threads: by one.
  --state: the folder, by more than 8 MiB (SQLite's log alone has 4 MiB before it is folded).
Environment as for the service tests: RADIOSITYD."""
import argparse
import json
import pathlib
import re
import shutil
import statistics
import sys
import tempfile
import time
import urllib.request
import uuid

from soak_load import ROOT, STRENGTH, WRITERS, Browser, Quota, Visitors, Writer, opened, run_round, scene

import plates  # noqa: E402: soak_load says where it is
from edit_load import ready_seconds
from harness import Server

ROUNDS, WARM_UP = 20, 5
MIB = 1 << 20
BOUNDS = {"memory_mib": 16.0, "tile_cache_mib": 64.0, "descriptors": 0, "threads": 0, "state_mib": 8.0}
SETTINGS = ("--texels", 2000, "--error", 0.05, "--max-clients", 200, "--workers", 2, "--log-level", "error")


def processes(server):
    """Of the server and its workers, by a name that stays when one is replaced."""
    return {"server": server.process.pid, **{f"worker {i}": pid for i, pid in enumerate(server.workers(), 1)}}


def usage(pid):
    folder = pathlib.Path(f"/proc/{pid}")
    status = (folder / "status").read_text()
    kib = sum(int(re.search(rf"^{name}:\s+(\d+) kB", status, re.MULTILINE).group(1)) for name in ("RssAnon", "RssShmem"))
    return {"memory_mib": round(kib / 1024, 2), "descriptors": sum(1 for _ in (folder / "fd").iterdir()),
            "threads": sum(1 for _ in (folder / "task").iterdir())}


def metrics(server):
    with urllib.request.urlopen(server.url + "/metrics", timeout=60) as reply:
        return dict(re.findall(r"^radiosityd_(\S+) (\S+)$", reply.read().decode(), re.MULTILINE))


def come_to_rest(server, seconds=120):
    """Until nobody is connected but who asks, and the solve has ended."""
    deadline = time.monotonic() + seconds
    while True:
        now = metrics(server)
        waiting = {name: now[name] for name in ("connections", "viewers", "uploads_held_bytes") if name in now}
        if waiting == {"connections": "1", "viewers": "0", "uploads_held_bytes": "0"} and \
                now['solve_state{state="converged"}'] == "1":
            return now
        if time.monotonic() > deadline:
            raise AssertionError(f"the server does not come to rest: {waiting}")
        time.sleep(0.1)


def sample(server, state):
    cached = int(come_to_rest(server)["tile_cache_bytes"])
    found = {name: usage(pid) for name, pid in processes(server).items()}
    found["server"]["memory_mib"] = round(found["server"]["memory_mib"] - cached / MIB, 2)
    found["server"]["tile_cache_mib"] = round(cached / MIB, 2)
    for _ in range(20):  # the connection that asked may be about to close
        time.sleep(0.02)
        for name, pid in processes(server).items():
            found[name]["descriptors"] = min(found[name]["descriptors"], usage(pid)["descriptors"])
    if state:
        size = sum(file.stat().st_size for file in state.rglob("*") if file.is_file())
        found["folder"] = {"state_mib": round(size / MIB, 2)}
    return found


def check_and_stir(server, writers):
    """All edits are there, each once; then what needs a quiet document: undo and redo, appending and taking away."""
    raw = opened(server.port)
    found = raw.call("scene.get")["gltf"]["extras"]
    wrong = {f"w{writer.number}": writer.count for writer in writers if found[f"w{writer.number}"] != writer.count}
    if wrong:
        raise AssertionError(f"edits are lost or made twice: {found}, of {wrong}")
    raw.call("scene.patch", patch=[{"op": "add", "path": "/nodes/-", "value": {"mesh": 0, "translation": [3, 0, 0]}},
                                   {"op": "add", "path": "/scenes/0/nodes/-", "value": 3}])
    raw.call("scene.undo")
    for _ in range(8):
        raw.call("scene.patch", patch=[{"op": "replace", "path": STRENGTH, "value": 3}])
        for method in ("scene.undo", "scene.redo", "scene.undo", "scene.history", "status", "scene.get"):
            raw.call(method)
    raw.call("solve.configure", seed=len(str(found)))
    raw.call("solve.restart")
    raw.call("snapshot", width=320, height=240)
    raw.reset()


def growth(samples, name, what):
    """Median of the last three samples over that of the three after the warm-up; 0 while there is nothing to compare."""
    if len(samples) <= WARM_UP:
        return 0
    values = [row[name][what] for row in samples[WARM_UP:]]
    return statistics.median(values[-3:]) - statistics.median(values[:3])


def judged(samples):
    """(process, what, after the warm-up, at the end, growth, bound) for all that is watched."""
    early, late = samples[min(WARM_UP, len(samples) - 1)], samples[-1]
    return [(name, what, early[name][what], late[name][what], round(growth(samples, name, what), 2), BOUNDS[what])
            for name in late for what in late[name]]


def markdown(result):
    lines = [f"{result['edits']} edits, {result['connections']} connections, {result['writers_cut_off']} of writers cut "
             f"off and taken up again, in {result['seconds']:.0f} s{', with --state' if result['state'] else ''}.", "",
             "| process | | after warm-up | end | growth of medians | bound |", "|---|---|---:|---:|---:|---:|"]
    lines += [f"| {name} | {what} | {early} | {late} | {grown:+} | {bound} |"
              for name, what, early, late, grown, bound in result["judged"]]
    lines += ["", "Server's memory after each round, MiB: " + ", ".join(str(row["server"]["memory_mib"])
                                                                         for row in result["samples"])]
    return "\n".join(lines) + "\n"


def write(result, folder):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "soak.json").write_text(json.dumps(result, indent=1) + "\n")
    (folder / "soak.md").write_text(markdown(result))


def soak(server, options, state):
    writers = [Writer(server.port, number) for number in range(WRITERS)]
    others = [Visitors(server.port, 1), Visitors(server.port, 2), Visitors(server.port, 3), Browser(server.port, 4)]
    result = {"edits": 0, "connections": 0, "state": state is not None, "samples": []}
    begun = time.monotonic()
    for number in range(ROUNDS):
        quota = Quota(options.edits // ROUNDS, options.connections // ROUNDS)
        run_round([*writers, *others], quota)
        check_and_stir(server, writers)
        result["samples"].append(sample(server, state))
        result["edits"] = sum(writer.count for writer in writers)
        result["connections"] += quota.done["connections"]
        result["writers_cut_off"] = sum(writer.reconnects for writer in writers)
        result["seconds"] = time.monotonic() - begun
        result["judged"] = judged(result["samples"])
        write(result, options.output)  # whoever ends it early has the rounds so far
        print(f"round {number + 1} of {ROUNDS}, {result['seconds']:.0f} s: {result['samples'][-1]}", file=sys.stderr, flush=True)
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--edits", type=int, default=40_000)
    parser.add_argument("--connections", type=int, default=4_000)
    parser.add_argument("--state", action="store_true", help="every edit goes to the disk")
    parser.add_argument("--output", type=pathlib.Path, default=ROOT / "out" / "bench")
    options = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="radiosity-soak-"))
    state = folder / "state" if options.state else None
    try:
        plates.write_glb(folder / "plates.glb", scene())
        begun = time.monotonic()
        server = Server(folder, folder / "plates.glb", *SETTINGS, *(("--state", state) if state else ()),
                        mark=uuid.uuid4().hex)
        try:
            ready_seconds(server.url, begun)
            result = soak(server, options, state)
            result["exit"] = server.terminate(60)
        finally:
            server.kill()
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    write(result, options.output)
    print(markdown(result))
    grown = [f"{name}: {what} grew by {growth}" for name, what, _, _, growth, bound in result["judged"] if growth > bound]
    for line in grown:
        print(line, file=sys.stderr)
    return 1 if grown or result["exit"] != 0 else 0


if __name__ == "__main__":
    sys.exit(main())
