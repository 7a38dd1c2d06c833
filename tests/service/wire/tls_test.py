"""TLS: the server's --tls-cert and --tls-key, by clients that are not ours (Python's ssl and websockets) and by ours."""
import asyncio
import contextlib
import json
import os
import re
import signal
import socket
import ssl
import subprocess
import threading
import time
import unittest
import urllib.error
import urllib.request
import warnings

import websockets

import plates
from harness import MARK, ServiceCase, program

# The test's own handshakes, for the metrics, must be done in this time too, on a busy machine.
PATIENCE = {"RADIOSITY_FAKE_PATIENCE_MS": "3000"}
SECONDS = 120  # until a test fails that waits for what does not come


class Tls(ServiceCase):
    def setUp(self):
        super().setUp()
        self.certificate, self.key = self.makeCertificate("server", "DNS:localhost,IP:127.0.0.1")
        self.trust = ssl.create_default_context(cafile=str(self.certificate))
        self.scene = self.folder / "any.glb"
        plates.write_glb(self.scene, plates.document())

    def openssl(self, *arguments):
        subprocess.run(["openssl", *map(str, arguments)], check=True, capture_output=True, cwd=self.folder)

    def makeCertificate(self, name, subject_alternatives):
        """A self-signed one, which is its own authority; with its key."""
        certificate, key = self.folder / f"{name}.pem", self.folder / f"{name}.key"
        self.openssl("req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "2",
                     "-subj", f"/CN={name}", "-addext", f"subjectAltName={subject_alternatives}", "-keyout", key, "-out",
                     certificate)
        return certificate, key

    def tlsServer(self, *arguments, **options):
        return self.server(self.scene, "--error", 1e-9, "--tls-cert", self.certificate, "--tls-key", self.key, *arguments,
                           **options)

    def get(self, server, path, trust=None):
        with urllib.request.urlopen(server.url + path, timeout=SECONDS, context=trust or self.trust) as reply:
            return reply.read().decode()

    def metric(self, server, name):
        return float(re.search(rf"^radiosityd_{name} (\S+)$", self.get(server, "/metrics"), re.MULTILINE).group(1))

    # ---- options ----

    def refusal(self, *arguments):
        """What the server says when it does not start for its options."""
        listen = () if "--listen" in arguments else ("--listen", "127.0.0.1:0")
        done = subprocess.run([program("RADIOSITYD"), *listen, *map(str, arguments)], timeout=60,
                              capture_output=True, text=True, check=False, env={**os.environ, MARK: self.mark})
        self.assertEqual(done.returncode, 2, done.stderr)
        return done.stderr

    def test_wrong_options_are_refused_by_name_and_reason(self):
        other = self.makeCertificate("other", "DNS:localhost")[1]
        locked, rubbish = self.folder / "locked.key", self.folder / "rubbish.pem"
        self.openssl("pkey", "-in", self.key, "-aes256", "-passout", "pass:sesame", "-out", locked)
        rubbish.write_text("no certificate")
        for certificate, key, words in (
                (self.certificate, None, ("--tls-key",)),
                (None, self.key, ("--tls-cert",)),
                (self.folder / "none.pem", self.key, ("--tls-cert", "none.pem", "cannot be read")),
                (rubbish, self.key, ("--tls-cert", "rubbish.pem", "not a PEM certificate")),
                (self.certificate, self.folder / "none.key", ("--tls-key", "none.key", "cannot be read")),
                (self.certificate, rubbish, ("--tls-key", "rubbish.pem", "not a PEM private key")),
                (self.certificate, other, ("--tls-key", "other.key", "not the key of the certificate")),
                (self.certificate, locked, ("--tls-key", "locked.key", "encrypted"))):
            given = [*(("--tls-cert", certificate) if certificate else ()), *(("--tls-key", key) if key else ())]
            said = self.refusal(*given)
            for word in words:
                self.assertIn(word, said, given)

    def test_another_address_still_needs_a_token(self):
        said = self.refusal("--listen", "0.0.0.0:0", "--tls-cert", self.certificate, "--tls-key", self.key)
        self.assertIn("--token-file", said)

    # ---- clients that are not ours ----

    def test_http_and_websocket_work_with_both_versions(self):
        server = self.tlsServer()
        self.assertTrue(server.url.startswith("https://"), server.url)
        for version in (ssl.TLSVersion.TLSv1_2, ssl.TLSVersion.TLSv1_3):
            trust = ssl.create_default_context(cafile=str(self.certificate))
            trust.minimum_version = trust.maximum_version = version
            self.assertEqual(self.get(server, "/healthz", trust), "ok\n")
            asyncio.run(asyncio.wait_for(self.seesTiles(server, trust), SECONDS))
        self.assertEqual(self.metric(server, "tls_handshakes_failed_total"), 0)
        expiry = self.metric(server, "tls_certificate_expiry_timestamp_seconds")
        self.assertAlmostEqual(expiry, time.time() + 2 * 86400, delta=3600)

    async def seesTiles(self, server, trust):
        async with websockets.connect(server.url.replace("https", "wss") + "/ws", subprotocols=["radiosity.v1"], ssl=trust,
                                      max_size=1 << 20, compression=None) as socket_:
            for number, call in enumerate(({"method": "hello", "params": {"client": "tls"}}, {"method": "subscribe"})):
                await socket_.send(json.dumps({"jsonrpc": "2.0", "id": number, **call}))
            while not isinstance(await socket_.recv(), bytes):
                pass

    def test_a_large_upload_that_is_refused_can_read_why(self):
        server = self.tlsServer("--max-upload", "1MiB")
        request = urllib.request.Request(server.url + "/scene", data=bytes(4 << 20), method="PUT")
        with self.assertRaises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request, timeout=SECONDS, context=self.trust)
        self.assertEqual(refused.exception.code, 413)
        refused.exception.close()

    def test_who_comes_again_brings_a_ticket_and_the_server_keeps_nothing(self):
        server = self.tlsServer()
        for tickets in (True, False):
            client = ssl.create_default_context(cafile=str(self.certificate))
            client.maximum_version = ssl.TLSVersion.TLSv1_2
            client.options |= 0 if tickets else ssl.OP_NO_TICKET
            session = None
            for again in (False, True):
                with socket.create_connection(("127.0.0.1", server.port), SECONDS) as plain:
                    with client.wrap_socket(plain, server_hostname="localhost", session=session) as secure:
                        secure.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
                        self.assertIn(b" 200 ", secure.recv(4096))
                        self.assertEqual(secure.session_reused, again and tickets)
                        session = secure.session

    def test_old_versions_are_refused(self):
        server = self.tlsServer()
        trust = ssl.create_default_context(cafile=str(self.certificate))
        trust.set_ciphers("ALL:@SECLEVEL=0")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            trust.minimum_version, trust.maximum_version = ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1
        with self.assertRaisesRegex(urllib.error.URLError, "(?i)version|alert"):
            self.get(server, "/healthz", trust)

    def test_a_plain_client_is_told_to_speak_tls(self):
        server = self.tlsServer()
        with self.assertRaises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(server.url.replace("https", "http") + "/healthz", timeout=SECONDS)
        self.assertEqual(refused.exception.code, 400)
        self.assertIn("use https://", json.load(refused.exception)["error"]["message"])
        refused.exception.close()
        said = self.complaint("status", server.url.replace("https", "http"), expect=1)
        self.assertIn("use https://", said)

    # ---- peers that take their time ----

    def end(self, connection):
        """Everything until the server closes."""
        connection.settimeout(SECONDS)
        text = b""
        try:
            while chunk := connection.recv(4096):
                text += chunk
        except ConnectionError:
            pass
        return text

    def test_a_slow_handshake_is_cut_off(self):
        server = self.tlsServer(env=PATIENCE)
        silent = socket.create_connection(("127.0.0.1", server.port))
        half = socket.create_connection(("127.0.0.1", server.port))
        self.addCleanup(silent.close)
        self.addCleanup(half.close)
        half.sendall(bytes([22, 3, 1, 2, 0, 1, 0, 1, 0xFC, 3, 3]))  # the beginning of a ClientHello
        self.assertEqual(self.end(silent), b"")
        self.assertEqual(self.end(half), b"")
        self.assertEqual(self.metric(server, "tls_handshakes_failed_total"), 2)
        self.assertEqual(self.metric(server, "tls_handshakes"), 0)

    def test_more_handshakes_than_allowed_are_refused_and_the_rest_served(self):
        server = self.tlsServer()
        waiting = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(64)]
        for connection in waiting:
            self.addCleanup(connection.close)
        one_more = socket.create_connection(("127.0.0.1", server.port))
        self.addCleanup(one_more.close)
        self.assertEqual(self.end(one_more), b"")
        for connection in waiting:
            connection.close()
        deadline = time.monotonic() + SECONDS
        while True:
            try:
                self.assertEqual(self.get(server, "/healthz"), "ok\n")
                break
            except OSError:  # the server has not seen yet that they are gone
                self.assertLess(time.monotonic(), deadline)

    def test_a_drain_ends_tls_connections(self):
        server = self.tlsServer()
        context = ssl.create_default_context(cafile=str(self.certificate))
        idle = context.wrap_socket(socket.create_connection(("127.0.0.1", server.port)), server_hostname="localhost")
        unfinished = socket.create_connection(("127.0.0.1", server.port))
        self.addCleanup(idle.close)
        self.addCleanup(unfinished.close)
        self.assertEqual(server.terminate(), 0)

    def test_a_drain_amid_handshakes_harms_nobody(self):
        """Connections are told of it while they become sessions: what that touches is seen by a thread sanitizer."""
        context = ssl.create_default_context(cafile=str(self.certificate))

        def visit(port, ready):
            with contextlib.suppress(OSError):
                plain = socket.create_connection(("127.0.0.1", port), SECONDS)
                ready.wait(SECONDS)
                with context.wrap_socket(plain, server_hostname="localhost") as session:
                    session.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
                    while session.recv(4096):
                        pass

        for _ in range(5):
            server = self.tlsServer()
            ready = threading.Barrier(25)
            visitors = [threading.Thread(target=visit, args=(server.port, ready)) for _ in range(24)]
            for visitor in visitors:
                visitor.start()
            ready.wait(SECONDS)
            self.assertEqual(server.terminate(), 0)
            for visitor in visitors:
                visitor.join(SECONDS)
                self.assertFalse(visitor.is_alive(), "its connection was not ended")

    # ---- another certificate ----

    def served(self, server):
        pem = ssl.get_server_certificate(("127.0.0.1", server.port))
        return ssl.PEM_cert_to_DER_cert(pem)

    def test_sighup_reads_the_certificate_again_and_a_bad_one_changes_nothing(self):
        server = self.tlsServer()
        before = self.served(server)
        good = self.certificate.read_bytes()
        self.certificate.write_text("rubbish")
        server.process.send_signal(signal.SIGHUP)
        self.waitForLog(server, "the old certificate stays")
        self.assertEqual(self.served(server), before)
        self.certificate.write_bytes(good)

        self.makeCertificate("server", "DNS:localhost,IP:127.0.0.1")
        server.process.send_signal(signal.SIGHUP)
        self.waitForLog(server, "certificate read again")
        self.assertEqual(self.served(server), ssl.PEM_cert_to_DER_cert(self.certificate.read_text()))
        self.assertNotEqual(self.served(server), before)

    def test_without_a_certificate_sighup_ends_nothing(self):
        server = self.server(self.scene)
        server.process.send_signal(signal.SIGHUP)
        self.waitForLog(server, "there is no certificate to read again")
        with socket.create_connection(("127.0.0.1", server.port), SECONDS) as plain:
            plain.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
            self.assertIn(b"200 OK", plain.recv(4096))

    def waitForLog(self, server, words):
        deadline = time.monotonic() + SECONDS
        while words not in server.log():
            self.assertLess(time.monotonic(), deadline, server.log())
            time.sleep(0.02)

    # ---- our client ----

    def test_our_client_connects_to_whom_it_trusts(self):
        token = self.folder / "token"
        token.write_text("0123456789abcdef0123\n")
        server = self.tlsServer("--token-file", token)
        access = ("--token-file", token)
        by_name = server.url.replace("127.0.0.1", "localhost")
        for url in (server.url, server.url.replace("https", "wss") + "/ws", by_name):
            self.client("status", url, *access, "--ca", self.certificate)
        self.client("status", server.url, *access, "--insecure")
        self.client("load", server.url, self.scene, *access, "--ca", self.certificate)
        script = self.folder / "script.txt"
        script.write_text("status\n")
        self.client("script", server.url, script, *access, "--ca", self.certificate)

    def test_our_client_refuses_whom_it_does_not_trust(self):
        server = self.tlsServer()
        said = self.complaint("status", server.url, expect=1)
        self.assertRegex(said, "not accepted: self-signed certificate.*--ca")
        other = self.makeCertificate("other", "DNS:elsewhere.example")
        foreign = self.server("--tls-cert", other[0], "--tls-key", other[1])
        said = self.complaint("status", foreign.url, "--ca", other[0], expect=1)
        self.assertRegex(said, "not made out to 127.0.0.1")
        said = self.complaint("status", server.url, "--ca", self.folder / "none.pem", expect=2)
        self.assertRegex(said, "--ca .*none.pem.*cannot be read")

    def test_our_client_is_told_of_a_server_without_tls(self):
        server = self.server(self.scene)
        said = self.complaint("status", server.url.replace("http", "https"), "--insecure", expect=1)
        self.assertIn("does not speak TLS", said)


if __name__ == "__main__":
    unittest.main()
