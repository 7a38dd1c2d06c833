"""attacks.py [--scene FILE] [--attack NAME]... [--output DIR]: how soon a server answers `status`, and an edit of a lamp,
while somebody else is hostile to it: files that cost much to load, pictures nobody waits for, connections that are none,
a folder of --state that goes. Each attack meets the same room, solved; what is measured is told apart into the time of
the attack and the seconds after it. Writes attacks.md and attacks.json.
Environment as for the service tests: RADIOSITYD."""
import argparse
import asyncio
import json
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request
import uuid

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "service" / "programs"))

import attack_scenes  # noqa: E402
from harness import Server  # noqa: E402
from wire import RpcError, Session  # noqa: E402

STATUS_PAUSE, EDIT_PAUSE = 0.01, 0.033
AFTER = 4.0  # seconds


# ---- who measures: a process of its own, which nothing that the attacker does slows down ----

async def _ask_status(url, note):
    session = await Session.open(url)
    while True:
        begun = note("status")
        await session.call("status")
        note("status", begun)
        await asyncio.sleep(STATUS_PAUSE)


async def _edit(url, note):
    session, count = await Session.open(url), 0
    while True:
        begun, count = note("edit"), count + 1
        refusal = ""
        try:
            await session.call("scene.patch", patch=[{"op": "replace", "path": attack_scenes.LAMP, "value": 5 + count % 50}])
        except RpcError as error:
            refusal = str(error)
        note("edit", begun, refusal)
        await asyncio.sleep(EDIT_PAUSE)


async def _probe(url, out):
    def note(kind, begun=None, refusal=""):
        now = time.monotonic()
        out.write(json.dumps([kind, now, None, ""] if begun is None else [kind, begun, now - begun, refusal]) + "\n")
        out.flush()
        return now
    await asyncio.gather(_ask_status(url, note), _edit(url, note))


def answered(rows, end):
    """What was asked and never answered took until the end."""
    done = [row for row in rows if row[2] is not None]
    open_ones = {row[0]: row for row in rows if row[2] is None}
    last = {row[0]: row[1] for row in done}
    return done + [[kind, row[1], end - row[1], ""] for kind, row in open_ones.items() if last.get(kind) != row[1]]


class Probe:
    """The measuring process: rows of [kind, begun, seconds, refusal], by the clock that all processes share."""

    def __init__(self, url, folder):
        self.path = pathlib.Path(folder) / f"probe-{uuid.uuid4().hex}"
        self.process = subprocess.Popen([sys.executable, "-B", __file__, "--probe", url, "--output", self.path])

    def rows(self):
        self.process.kill()
        self.process.wait()
        lines = self.path.read_text().splitlines(keepends=True)
        return answered([json.loads(line) for line in lines if line.endswith("\n")], time.monotonic())


# ---- attacks ----

def put(server, data, patience=300):
    request = urllib.request.Request(server.url + "/scene?name=scene.glb", data=data, method="PUT",
                                     headers={"Content-Type": "model/gltf-binary"})
    try:
        with urllib.request.urlopen(request, timeout=patience) as reply:
            return f"{reply.status}"
    except urllib.error.HTTPError as refused:
        with refused:
            return f"{refused.code}: {refused.read().decode(errors='replace')[:160]}"


def file(make):
    """Somebody loads this file."""
    data = make()
    def attack(server, _):
        return put(server, data)
    attack.bytes = len(data)
    return attack


NONSENSE = (b"GET / HTTP/1.1\r\nHost: x\r\nContent-Length: -1\r\n\r\n", b"\x16\x03\x01" + b"\0" * 512, b"GET " + b"/" * 9000,
            b"PUT /scene HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
            b"POST /rpc HTTP/1.1\r\nHost: x\r\nContent-Length: 5\r\nContent-Length: 6\r\n\r\n{}", b"\0" * 4096,
            b"GET /ws HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: !\r\n\r\n")


def malformed_http(seconds=5.0):
    def attack(server, _):
        end, count = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            with socket.create_connection(("127.0.0.1", server.port), timeout=5) as connection:
                try:
                    connection.sendall(NONSENSE[count % len(NONSENSE)])
                    connection.shutdown(socket.SHUT_WR)
                    connection.recv(4096)
                except OSError:
                    pass
            count += 1
        return f"{count} connections"
    return attack


def slow_clients(count=200, seconds=8.0):
    """Headers that drip, and viewers that take nothing."""
    def attack(server, _):
        connections = []
        for _ in range(count):
            connection = socket.create_connection(("127.0.0.1", server.port), timeout=5)
            connection.sendall(b"PUT /scene?name=a.glb HTTP/1.1\r\nHost: x\r\n")
            connections.append(connection)
        end, dropped = time.monotonic() + seconds, 0
        while time.monotonic() < end:
            for connection in connections:
                try:
                    connection.sendall(b"X: y\r\n")
                except OSError:
                    dropped += 1
            time.sleep(0.1)
        for connection in connections:
            connection.close()
        return f"{count} connections"
    return attack


def snapshots_left(count=6):
    """The largest picture, asked for by one after the other that leaves at once."""
    def attack(server, _):
        for _ in range(count):
            with socket.create_connection(("127.0.0.1", server.port), timeout=5) as connection:
                connection.sendall(b"GET /snapshot.png?width=4096&height=4096 HTTP/1.1\r\nHost: x\r\n\r\n")
                time.sleep(0.4)
        return f"{count} pictures"
    return attack


def state_removed():
    def attack(_, state):
        shutil.rmtree(state)
        time.sleep(3.0)
        return "removed"
    return attack


def attacks():
    make = attack_scenes
    return {"nothing": lambda: lambda *_: time.sleep(5.0) or "",
            "the room itself, loaded again": lambda: lambda server, _: put(server, server.room),
            "a thousand million instances claimed": lambda: file(make.instances_claimed),
            "an accessor of four thousand million": lambda: file(make.accessor_bomb),
            "10,000 nodes in one place": lambda: file(make.nodes_in_one_place),
            "10,000 leaning slabs": lambda: file(make.leaning_slabs),
            "10,000 leaning tubes": lambda: file(make.leaning_tubes),
            "forty pictures of 4096 x 4096": lambda: file(make.forty_pictures),
            "500 cut-offs of one picture": lambda: file(make.cut_off_pictures),
            "a picture of 8192 x 8192": lambda: file(make.large_picture),
            "five pictures of 2048 x 2048, of noise": lambda: file(make.many_pictures),
            "a picture of 8192 x 8192, of 16 bits": lambda: file(make.deep_picture),
            "a JPEG of 6,000 scans": lambda: file(make.picture_of_scans),
            "a picture of 16 x 16 that inflates to 1 GB": lambda: file(make.inflating_picture),
            "four WebP of 8192 x 8192, 26 bytes each": lambda: file(make.solid_webps),
            "2,000 pictures of 64 x 64": lambda: file(make.tiny_pictures),
            "a mebibyte of empty nodes": lambda: file(make.entries_of("nodes")),
            "a mebibyte of empty materials": lambda: file(make.entries_of("materials")),
            "18,000 point lights": lambda: file(make.point_lights),
            "14,000 squares that shine": lambda: file(make.shining_squares),
            "10,000 poses of 1,000 triangles": lambda: file(make.poses),
            "24,000 nodes": lambda: file(lambda: make.many_nodes(24_000)),
            "60,000 nodes": lambda: file(make.many_nodes),
            "a ground of 320,000 triangles": lambda: file(make.many_triangles),
            "malformed HTTP": malformed_http,
            "200 slow clients": slow_clients,
            "snapshots of 4096 x 4096, left": snapshots_left,
            "the folder of --state removed": state_removed}


# ---- measuring ----

def percentiles(values):
    ordered = sorted(values)
    def at(part):
        return round(ordered[min(len(ordered) - 1, int(part * len(ordered)))] * 1000, 1) if ordered else None
    return {"count": len(ordered), "p50": at(0.5), "p99": at(0.99), "max": at(1.0)}


def settle(server):
    async def wait():
        session = await Session.open(server.url)
        await session.call("solve.wait", timeoutMs=120000)
        await session.close()
    asyncio.run(wait())


def peak_mib(server):
    status = pathlib.Path(f"/proc/{server.process.pid}/status").read_text()
    return round(int(status.split("VmHWM:")[1].split()[0]) / 1024)


def measure(attack, room, folder, arguments):
    state = folder / "state"
    server = Server(folder, "--state", state, *arguments, mark=uuid.uuid4().hex)
    try:
        server.room = room
        loaded = put(server, room)
        assert loaded.startswith("200"), loaded
        settle(server)
        probe = Probe(server.url, folder)
        time.sleep(1.0)
        begun = time.monotonic()
        outcome = attack(server, state)
        ended = time.monotonic()
        time.sleep(AFTER)
        rows, refusals = probe.rows(), {}
        result = {"outcome": outcome, "seconds": round(ended - begun, 2), "peak_mib": peak_mib(server),
                  "bytes": getattr(attack, "bytes", None)}
        for kind in ("status", "edit"):
            def during(row):
                return row[0] == kind and row[1] < ended and row[1] + row[2] > begun
            result[kind] = percentiles([row[2] for row in rows if during(row)])
            result[kind + "_after"] = percentiles([row[2] for row in rows if row[0] == kind and row[1] >= ended])
        for row in rows:
            if row[3]:
                refusals[row[3]] = refusals.get(row[3], 0) + 1
        result["refused"] = refusals
        return result
    finally:
        server.kill()
        shutil.rmtree(state, ignore_errors=True)


def markdown(results):
    out = ["| attack | answered | s | peak MiB | status p50, p99, max, ms | edit p50, p99, max, ms | edits after it |",
           "|---|---|---:|---:|---:|---:|---:|"]
    for name, result in results.items():
        def of(kind):
            return ", ".join(str(result[kind][key]) for key in ("p50", "p99", "max"))
        out.append(f"| {name} | {result['outcome'][:60]} | {result['seconds']} | {result['peak_mib']} | {of('status')} | "
                   f"{of('edit')} | {of('edit_after')} |")
        out += [f"  {count} refused: {text}" for text, count in result["refused"].items()]
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--probe", help=argparse.SUPPRESS)
    parser.add_argument("--scene", default=ROOT / "build" / "scenes" / "room_small.glb")
    parser.add_argument("--attack", action="append", default=[], help="only those whose name contains one of these")
    parser.add_argument("--output", type=pathlib.Path, default=pathlib.Path("out/bench"))
    options, more = parser.parse_known_args()
    if options.probe:
        with open(options.output, "w") as out:
            asyncio.run(_probe(options.probe, out))
        return
    room, results = attack_scenes.room(options.scene), {}
    folder = pathlib.Path(tempfile.mkdtemp(prefix="radiosity-attacks-"))
    try:
        for name, make in attacks().items():
            if options.attack and not any(part in name for part in options.attack):
                continue
            results[name] = measure(make(), room, folder, more)
            print(name, json.dumps(results[name]), flush=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    options.output.mkdir(parents=True, exist_ok=True)
    (options.output / "attacks.json").write_text(json.dumps(results, indent=2) + "\n")
    (options.output / "attacks.md").write_text(markdown(results))
    print(markdown(results))


if __name__ == "__main__":
    main()
