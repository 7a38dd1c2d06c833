"""Clients that take and give nothing, or too much, or vanish: each is cut off, and nobody else notices. No claims about
seconds: what must come is waited for, and a hang is a failure."""
import concurrent.futures
import itertools
import json
import os
import pathlib
import re
import resource
import socket
import threading
import time
import unittest
import urllib.request

from harness import ServiceCase
from raw_socket import BINARY, PING, TEXT, RawSocket, frame

# Under a sanitizer a viewer that keeps up may be held up for as long as that.
PATIENCE = {"RADIOSITY_FAKE_PATIENCE_MS": "2000" if os.environ.get("RADIOSITY_SANITIZED") == "1" else "400"}
LARGEST_CREDIT = 64 << 20


class Abuse(ServiceCase):
    def setUp(self):
        super().setUp()
        scene = self.folder / "any.glb"
        scene.write_bytes(b"glTF")
        # The fake engine publishes every 50 ms; an error that is never reached keeps it at it.
        self.scene = (scene, "--error", 1e-9)

    def metric(self, server, name):
        with urllib.request.urlopen(server.url + "/metrics", timeout=120) as reply:
            found = re.search(rf"^radiosityd_{re.escape(name)} (\S+)$", reply.read().decode(), re.MULTILINE)
        return float(found.group(1))

    def eventually(self, holds):
        deadline = time.monotonic() + 120
        while not holds():
            self.assertLess(time.monotonic(), deadline, "it never came")
            time.sleep(0.02)

    def viewer(self, server, credit=LARGEST_CREDIT, receive_buffer=None, subscribe=True, finest=0):
        raw = RawSocket(server.port, receive_buffer)
        self.addCleanup(raw.socket.close)
        raw.upgrade()
        raw.hello(creditBytes=credit, tileFormats=["rgba32f"])
        if subscribe:
            call = {"jsonrpc": "2.0", "id": 1, "method": "subscribe", "params": {"minMip": finest}}
            raw.send(frame(TEXT, json.dumps(call).encode()))
        return raw

    def isThere(self, raw):
        try:
            raw.call("viewers")
        except (EOFError, OSError):
            return False
        return True

    def reader(self, server):
        """A viewer that keeps up: a bookmark comes only to those who do, and under a sanitizer whole pages take longer to
        encode than the fake engine takes to publish the next."""
        return self.viewer(server, finest=2)

    def versionsSeen(self, raw, wanted):
        """Reads until so many bookmarks have come, giving credit back."""
        seen = 0
        while seen < wanted:
            _, opcode, payload = raw.frame()
            if opcode == BINARY:
                note = {"jsonrpc": "2.0", "method": "credit", "params": {"bytes": len(payload)}}
                raw.send(frame(TEXT, json.dumps(note).encode()))
            elif opcode == TEXT and json.loads(payload).get("method") == "bookmark":
                seen += 1

    def assertGrewLess(self, server, before, limit_bytes, about=None):
        # A sanitizer keeps freed memory back, to see who still uses it.
        if os.environ.get("RADIOSITY_SANITIZED") != "1":
            self.assertLess(self.residentBytes(server) - before, limit_bytes, about)

    def residentBytes(self, server):
        status = pathlib.Path(f"/proc/{server.process.pid}/status").read_text()
        return int(re.search(r"VmRSS:\s+(\d+) kB", status).group(1)) * 1024

    def test_one_who_never_reads_is_cut_off_and_holds_nobody_up(self):
        server = self.server(*self.scene, env=PATIENCE)
        self.viewer(server, receive_buffer=4096)
        good = self.reader(server)
        self.versionsSeen(good, 5)
        self.eventually(lambda: self.metric(server, 'sessions_closed_total{reason="too_slow"}') == 1)
        self.versionsSeen(good, 5)
        self.eventually(lambda: self.metric(server, "viewers") == 1)

    def test_one_who_reads_byte_by_byte_is_cut_off(self):
        server = self.server(*self.scene, env=PATIENCE)
        slow = self.viewer(server, receive_buffer=2048)

        def gone():
            try:
                slow.socket.recv(1)
            except ConnectionError:
                pass
            return self.metric(server, "viewers") == 0

        self.eventually(gone)
        self.assertEqual(self.metric(server, 'sessions_closed_total{reason="too_slow"}'), 1)

    def test_one_who_stalls_but_pings_is_cut_off(self):
        server = self.server(*self.scene, env=PATIENCE)
        stalled = self.viewer(server, receive_buffer=4096)
        stalled.socket.settimeout(0.05)

        def gone():
            try:
                stalled.socket.send(frame(PING, b"x" * 125))
            except TimeoutError:
                pass  # the server does not read from one who does not either
            except OSError:
                return True
            return self.metric(server, "viewers") == 0

        self.eventually(gone)
        self.assertEqual(self.metric(server, 'sessions_closed_total{reason="too_slow"}'), 1)

    def test_pings_without_reading_take_no_memory(self):
        server = self.server(env=PATIENCE)  # no scene: nothing else is written
        before = self.residentBytes(server)
        pinger = self.viewer(server, receive_buffer=4096, subscribe=False)
        pinger.socket.settimeout(1)
        pings, sent = frame(PING, b"x" * 125) * 100, 0
        try:
            for _ in range(1000):  # 13 MB, if it were taken
                sent += pinger.socket.send(pings)
        except (TimeoutError, ConnectionError):
            pass
        self.assertGrewLess(server, before, 4 << 20, f"{sent} bytes of pings")

    def test_headers_that_drip_do_not_keep_others_out(self):
        server = self.server("--max-clients", 12, env=PATIENCE)
        drips = [RawSocket(server.port) for _ in range(10)]
        for raw in drips:
            self.addCleanup(raw.socket.close)
            raw.send(b"GET /ws HTTP/1.1\r\nX-")
        open_ones = set(drips)
        while open_ones:
            for raw in list(open_ones):
                raw.socket.settimeout(0.01)
                try:
                    raw.socket.send(b"a")
                    if not raw.socket.recv(1):
                        open_ones.remove(raw)
                except TimeoutError:
                    pass
                except OSError:
                    open_ones.remove(raw)
        self.viewer(server, subscribe=False)

    def test_connections_that_say_nothing_are_closed(self):
        server = self.server("--max-clients", 12, env=PATIENCE)
        silent = [RawSocket(server.port) for _ in range(10)]
        for raw in silent:
            self.addCleanup(raw.socket.close)
            self.assertEqual(raw.socket.recv(1), b"")

    def test_sockets_that_never_say_hello_are_closed(self):
        server = self.server(env=PATIENCE)
        raw = RawSocket(server.port)
        self.addCleanup(raw.socket.close)
        raw.upgrade()
        self.assertEqual(raw.end(), 1008)

    def test_more_clients_than_the_limit_are_told_so(self):
        server = self.server("--max-clients", 4)
        kept = []
        for _ in range(5):
            kept += [self.viewer(server, subscribe=False) for _ in range(4 - len(kept))]
            with RawSocket(server.port) as late:
                told = late.socket.recv(4096)
            # On a machine that stalls, one that has answered no ping for half a minute was let go: it proves nothing.
            present = [raw for raw in kept if self.isThere(raw)]
            if len(present) == 4:
                break
            kept = present
        self.assertEqual(len(present), 4)
        self.assertIn(b" 503 ", told)
        kept[0].reset()

        def admitted():
            with RawSocket(server.port) as again:
                again.send(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
                return b" 200 " in again.socket.recv(4096)

        self.eventually(admitted)

    def test_never_are_more_in_than_the_limit_whoever_comes_and_goes(self):
        """Counted by the clients themselves: in once they are answered, out before they close."""
        server = self.server("--max-clients", 4)
        tally, lock, end = {"in": 0, "most": 0, "refused": 0}, threading.Lock(), time.monotonic() + 3

        def visit(number):
            for turn in itertools.count(number):
                if time.monotonic() > end and tally["refused"]:
                    return
                with RawSocket(server.port) as raw:
                    if turn % 4 == 0:  # half a handshake takes a place too
                        raw.send(b"GET /ws HT")
                        continue
                    if not self.isIn(raw, upgrade=turn % 2 == 0):
                        tally["refused"] += 1
                        continue
                    with lock:
                        tally["in"] += 1
                        tally["most"] = max(tally["most"], tally["in"])
                    time.sleep(0.002)
                    with lock:
                        tally["in"] -= 1

        with concurrent.futures.ThreadPoolExecutor(16) as visitors:
            list(visitors.map(visit, range(16)))
        self.assertIn(tally["most"], range(1, 5))
        self.eventually(lambda: self.metric(server, "connections") == 1)  # the one that asks

    def isIn(self, raw, upgrade):
        try:
            if upgrade:
                return " 101 " in raw.upgrade()
            raw.send(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
            return b" 200 " in raw.socket.recv(4096)
        except (EOFError, ConnectionError):
            return False

    def test_a_storm_of_reconnections_leaves_nothing_behind(self):
        server = self.server(*self.scene, env=PATIENCE)

        def storm(count):
            for i in range(count):
                raw = self.viewer(server, receive_buffer=4096)
                if i % 3 == 0:
                    raw.reset()
                elif i % 3 == 1:
                    raw.socket.close()
                else:
                    raw.socket.shutdown(socket.SHUT_WR)
                    raw.socket.close()
            self.eventually(lambda: self.metric(server, "viewers") == 0)
            self.eventually(lambda: self.metric(server, "connections") == 1)  # the one that asks

        storm(60)
        before = self.residentBytes(server)
        storm(240)
        # Tiles in the shared cache grow to their bound whoever asks; sessions would be megabytes each.
        self.assertGrewLess(server, before, (64 << 20) + (16 << 20))
        self.versionsSeen(self.reader(server), 2)

    def test_a_flood_of_calls_is_answered_or_refused_and_ends(self):
        server = self.server()
        raw = self.viewer(server, subscribe=False)
        call = frame(TEXT, b'{"jsonrpc":"2.0","id":"x","method":"status"}')
        raw.socket.settimeout(2)
        try:
            for _ in range(200):
                raw.socket.sendall(call * 50)
        except (TimeoutError, ConnectionError):
            pass
        self.eventually(lambda: self.metric(server, 'sessions_closed_total{reason="overload"}') == 1 or
                        self.metric(server, "calls_total") >= 10_000)
        self.viewer(server, subscribe=False).call("status")

    def test_a_viewer_who_never_reads_does_not_hold_up_the_end(self):
        # The grace is ten minutes here, so only cutting the stalled one off lets the server end.
        server = self.server(*self.scene, env={"RADIOSITY_FAKE_PATIENCE_MS": "1000"})
        stalled = self.viewer(server, receive_buffer=4096)
        time.sleep(0.3)  # so that a write is stuck
        self.assertEqual(server.terminate(), 0, server.log())
        stalled.reset()

    def test_uploads_share_a_room_that_is_bounded(self):
        server = self.server(*self.scene, "--max-upload", "1MiB")
        size = 1 << 20

        def upload(bytes_sent):
            raw = RawSocket(server.port)
            self.addCleanup(raw.socket.close)
            raw.send(b"PUT /uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n\r\n" % size + bytes(bytes_sent))
            return raw

        patient = [upload(size - 1) for _ in range(2)]
        self.eventually(lambda: self.metric(server, "uploads_held_bytes") == 2 * (size - 1))
        self.assertIn(b"503 Service Unavailable", upload(1000).socket.recv(4096))
        for raw in patient:  # those who were there first are served
            raw.send(b"x")
            self.assertIn(b"201 Created", raw.socket.recv(4096))
        self.eventually(lambda: self.metric(server, "uploads_held_bytes") == 0)
        self.assertIn(b"201 Created", upload(size).socket.recv(4096))

    def test_memory_that_runs_out_takes_one_connection_and_no_other(self):
        server = self.server(*self.scene)
        status = pathlib.Path(f"/proc/{server.process.pid}/status").read_text()
        used = int(re.search(r"VmSize:\s+(\d+) kB", status).group(1)) * 1024
        if used > 1 << 40:
            self.skipTest("a sanitizer takes all addresses there are, and ends the program instead")
        viewer = self.reader(server)
        limit = used + (256 << 20)
        resource.prlimit(server.process.pid, resource.RLIMIT_AS, (limit, limit))
        greedy = RawSocket(server.port)
        self.addCleanup(greedy.socket.close)
        greedy.send(b"PUT /uploads HTTP/1.1\r\nHost: localhost\r\nContent-Length: %d\r\n\r\n0123" % (1 << 30))
        self.assertEqual(greedy.socket.recv(4096), b"")
        self.versionsSeen(viewer, 3)
        self.assertIn("out of memory", server.log())

    def test_an_upload_that_stalls_does_not_hold_up_the_end(self):
        server = self.server(*self.scene, env=PATIENCE)
        half = RawSocket(server.port)
        self.addCleanup(half.socket.close)
        half.send(b"PUT /scene HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100000\r\n\r\nsome")
        time.sleep(0.1)
        self.assertEqual(server.terminate(), 0, server.log())


if __name__ == "__main__":
    unittest.main()
