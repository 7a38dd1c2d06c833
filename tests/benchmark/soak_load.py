"""What goes on at a server over a long time: writers that edit it without pause, viewers that come and leave in every
way there is, HTTP, and peers that talk nonsense. Blocking sockets, a thread each; used by soak.py."""
import http.client
import json
import pathlib
import random
import socket
import struct
import sys
import threading

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests" / "service" / "programs"))
sys.path.insert(0, str(ROOT / "tests" / "service" / "wire"))

import plates  # noqa: E402
from raw_socket import BINARY, CLOSE, TEXT, RawSocket, close_payload, frame  # noqa: E402

WRITERS, BATCH = 4, 32
STRENGTH = "/materials/@lamp/extensions/KHR_materials_emissive_strength/emissiveStrength"
GEOMETRY_EVERY = 1000  # edits of a writer
PATIENCE = 120  # seconds that an answer may take on a crowded machine
QUANTITIES = ("irradiance", "radiosity", "error", "patchId", "mipLevel", "unshot", "normal")
FORMATS = ("rgba16f", "rgb9e5", "rgba32f")
GONE = (OSError, EOFError)


def scene():
    """Two plates; each writer counts up a number of its own in the document."""
    document = plates.lit_document()
    document["extras"] = {f"w{writer}": 0 for writer in range(WRITERS)}
    return document


def call(number, method, **params):
    return {"jsonrpc": "2.0", "id": number, "method": method, "params": params}


def text(message):
    return frame(TEXT, json.dumps(message).encode())


class Quota:
    """How much of a round is done, of edits and of connections; the faster of the two kinds waits for the other, so that
    both go on all the time."""

    def __init__(self, edits, connections):
        self.wanted = {"edits": edits, "connections": connections}
        self.done = {"edits": 0, "connections": 0}
        self.failure = None
        self.change = threading.Condition()

    def _share(self, kind):
        return self.done[kind] / max(1, self.wanted[kind])

    def take(self, kind, count=1):
        """False when there is nothing left to do. Waits while this kind is ahead."""
        other = "connections" if kind == "edits" else "edits"
        with self.change:
            while self.failure is None and self.done[kind] < self.wanted[kind]:
                if self._share(kind) <= self._share(other) + 0.02 or self.done[other] >= self.wanted[other]:
                    self.done[kind] += count
                    self.change.notify_all()
                    return True
                self.change.wait(1)
            return False

    def over(self):
        return self.failure is not None or all(self.done[kind] >= self.wanted[kind] for kind in self.wanted)

    def fail(self, error):
        with self.change:
            self.failure = self.failure or error
            self.change.notify_all()


def opened(port, **hello):
    raw = RawSocket(port)
    raw.socket.settimeout(PATIENCE)
    if "101" not in (head := raw.upgrade()).split("\r\n")[0]:
        raise AssertionError(f"no upgrade: {head}")
    raw.hello(**hello)
    return raw


class Writer:
    """Edits in batches, each with a requestId. After a lost connection the batch is sent again as it was: an edit is made
    once, and the answers say so."""

    def __init__(self, port, number):
        self.port, self.number, self.count, self.reconnects, self.raw = port, number, 0, 0, None

    def edit(self):
        self.count += 1
        patch = [{"op": "replace", "path": f"/extras/w{self.number}", "value": self.count}]
        if self.count % 3:
            patch.append({"op": "replace", "path": STRENGTH, "value": 5 + self.count % 7})
        if self.count % GEOMETRY_EVERY == 0:
            height = 0.01 * (self.count // GEOMETRY_EVERY % 9)
            patch.append({"op": "replace", "path": "/nodes/@lamp/translation", "value": [0, height, 0]})
        return call(self.count, "scene.patch", patch=patch, requestId=f"writer-{self.number}-{self.count}")

    def work(self, quota):
        while quota.take("edits", BATCH):
            batch = [self.edit() for _ in range(BATCH)]
            while not self.made(batch):
                self.reconnects += 1
        if self.raw is not None:  # of a short round the others may have made all edits
            self.raw.reset()
        self.raw = None

    def made(self, batch):
        """False: the connection was lost, and nobody knows what became of it."""
        try:
            self.raw = self.raw or opened(self.port)
            self.raw.socket.sendall(text(batch))
            while True:
                _, opcode, payload = self.raw.frame()
                if opcode == CLOSE:
                    raise EOFError
                if opcode == TEXT and payload.startswith(b"["):
                    break
        except GONE:
            if self.raw is not None:  # it may not have come to be
                self.raw.socket.close()
            self.raw = None
            return False
        answers = sorted(json.loads(payload), key=lambda answer: answer["id"])
        wanted = [request["id"] for request in batch]
        if [answer["id"] for answer in answers] != wanted or any("result" not in answer for answer in answers):
            raise AssertionError(f"writer {self.number}: {answers}")
        return True


class Visitors:
    """Viewers one after the other, each of another kind."""

    def __init__(self, port, seed):
        self.port, self.dice, self.last = port, random.Random(seed), None
        self.kinds = (self.watch, self.watch, self.watch, self.resume, self.stall, self.say_nothing, self.half_a_handshake,
                      self.share_a_camera, self.nonsense)

    def work(self, quota):
        while quota.take("connections"):
            try:
                self.dice.choice(self.kinds)()
            except TimeoutError:
                raise
            except GONE:
                pass  # cut off by the server: it has its reasons

    def leave(self, raw, speaks=True):
        """With a close frame, which is answered (where WebSocket is spoken yet); with an end of sending; or with a reset."""
        way = self.dice.randrange(0 if speaks else 1, 4)
        if way == 0:
            raw.send(frame(CLOSE, close_payload(1000)))
            raw.end()
        elif way == 1:
            raw.socket.shutdown(socket.SHUT_WR)
        elif way == 2:
            raw.reset()
        raw.socket.close()

    def watch(self, **hello):
        raw = opened(self.port, tileFormats=[self.dice.choice(FORMATS)], codecs=[self.dice.choice(("none", "deflate"))],
                     creditBytes=self.dice.choice((10_000, 1 << 20)), **hello)
        raw.send(text(call("s", "subscribe", quantity=self.dice.choice(QUANTITIES), maxHz=self.dice.choice((0, 5)))))
        raw.send(text(call("w", "solve.wait", error=1e-6, timeoutMs=3_600_000)))  # nobody will hear the answer
        try:
            raw.socket.settimeout(0.5)
            for _ in range(self.dice.randrange(60)):
                self.take(raw)
        except TimeoutError:
            pass  # nothing happens here any more
        raw.socket.settimeout(PATIENCE)
        self.leave(raw)

    def take(self, raw):
        _, opcode, payload = raw.frame()
        if opcode == BINARY:
            raw.send(text({"jsonrpc": "2.0", "method": "credit", "params": {"bytes": len(payload)}}))
        elif opcode == TEXT and b'"bookmark"' in payload:
            self.last = json.loads(payload)["params"]

    def resume(self):
        self.watch(resume={"epoch": "0" * 16, "revision": 1, "tileVersion": 1} if self.last is None else
                   {"epoch": self.epoch(), **self.last})

    def epoch(self):
        with RawSocket(self.port) as raw:
            raw.upgrade()
            while True:
                _, opcode, payload = raw.frame()
                if opcode == TEXT:
                    return json.loads(payload)["params"]["epoch"]

    def stall(self):
        raw = RawSocket(self.port, 4096)
        raw.upgrade()
        raw.send(text(call(1, "hello", client="stall", creditBytes=64 << 20)) + text(call(2, "subscribe")))
        self.leave(raw)

    def say_nothing(self):
        RawSocket(self.port).socket.close()

    def half_a_handshake(self):
        raw = RawSocket(self.port)
        raw.send(b"GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: web" * self.dice.randrange(3))
        self.leave(raw, speaks=False)

    def share_a_camera(self):
        raw = opened(self.port)
        raw.call("camera", position=[0, 1, 2], target=[0, 0, 0])
        self.leave(raw)

    def nonsense(self):
        raw = opened(self.port)
        for data in (frame(TEXT, b"{"), frame(TEXT, b"[" * 100), frame(TEXT, b'{"jsonrpc":"2.0","id":1,"method":"no"}'),
                     text(call(1, "scene.patch", patch=[{"op": "replace", "path": "/nodes/99/scale", "value": [1, 1, 1]}])),
                     text(call(2, "scene.load", url="/uploads/none")), text(call(3, "solve.configure", targetError=7)),
                     self.dice.choice((frame(BINARY, b"x"), frame(TEXT, b"\xff"), frame(3), frame(TEXT, masked=False),
                                       frame(TEXT, b" " * ((1 << 20) + 1))))):
            raw.send(data)
        raw.end()
        raw.socket.close()


class Browser:
    """HTTP, well-formed and not."""

    GETS = ("/", "/status", "/scene.gltf", "/scene.glb", "/scene-unlit.glb", "/lightmaps/0.exr", "/lightmaps/99.exr",
            "/lightmaps/0.exr?quantity=error", "/snapshot.png?width=64&height=48", "/snapshot.png?width=x", "/healthz",
            "/readyz", "/metrics", "/nothing", "/snapshots/0.png", "/uploads/none")

    def __init__(self, port, seed):
        self.port, self.dice = port, random.Random(seed)

    def work(self, quota):
        while quota.take("connections"):
            self.visit()

    def visit(self):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        try:
            for _ in range(self.dice.randrange(1, 4)):
                self.ask(connection)
        except (http.client.HTTPException, OSError):
            pass  # refused in the middle of a body
        finally:
            connection.close()

    def ask(self, connection):
        way = self.dice.randrange(8)
        if way < 5:
            connection.request(self.dice.choice(("GET", "GET", "HEAD", "OPTIONS", "POST")), self.dice.choice(self.GETS))
        elif way == 5:
            connection.request("PUT", "/uploads", self.dice.randbytes(self.dice.randrange(1, 1 << 16)))
        elif way == 6:
            connection.request("PUT", "/scene", self.dice.choice((b"glTF", b"{}", b"", self.dice.randbytes(1000))))
        else:
            connection.sock = socket.create_connection(("127.0.0.1", self.port), PATIENCE)
            connection.sock.sendall(b"PUT /scene HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\nsome")
            connection.sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            return connection.close()
        return connection.getresponse().read()


def run_round(workers, quota):
    """All at once until the quota is used up. Raises what the first of them raised."""
    def guarded(worker):
        try:
            worker.work(quota)
        except BaseException as error:  # noqa: BLE001: told to whoever waits for the round
            quota.fail(error)

    threads = [threading.Thread(target=guarded, args=(worker,)) for worker in workers]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if quota.failure is not None:
        raise quota.failure
