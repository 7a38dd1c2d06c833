"""What a machine room sees of the server: metrics, probes, logs, and what it tells systemd."""
import asyncio
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import time
import unittest
import urllib.error
import urllib.request

import metrics_text
import plates
from harness import ServiceCase
from patience import PATIENCE
from wire import Session

DASHBOARD = pathlib.Path(__file__).resolve().parents[3] / "docker/grafana/radiosityd.json"
SECONDS = 120 * PATIENCE  # until a test fails that waits for what does not come


class Observe(ServiceCase):
    def setUp(self):
        super().setUp()
        self.scene = self.folder / "plates.glb"
        plates.write_glb(self.scene, plates.document())

    def get(self, server, path):
        """(status, text)"""
        try:
            with urllib.request.urlopen(server.url + path, timeout=SECONDS) as reply:
                return reply.status, reply.read().decode()
        except urllib.error.HTTPError as refused:
            with refused:
                return refused.code, refused.read().decode()

    def until(self, holds, seconds=SECONDS):
        deadline = time.monotonic() + seconds
        while not (value := holds()):
            self.assertLess(time.monotonic(), deadline, "it never came")
            time.sleep(0.02)
        return value

    def solved(self, *arguments, **options):
        server = self.server(self.scene, "--error", "0.1", "--texels", "500", *arguments, **options)
        self.until(lambda: 'solve_state{state="converged"} 1' in self.get(server, "/metrics")[1])
        return server

    # ---- metrics ----

    def test_metrics_are_what_prometheus_reads(self):
        server = self.solved()
        text = self.get(server, "/metrics")[1]
        families = metrics_text.parse(text)
        self.assertTrue(all(name.startswith("radiosityd_") for name in families))
        self.assertEqual(sum(families["radiosityd_solve_state"].samples.values()), 1)
        self.assertGreater(families["radiosityd_shots_total"].samples[()], 0)
        if promtool := shutil.which("promtool"):
            done = subprocess.run([promtool, "check", "metrics"], input=text, capture_output=True, text=True, check=False)
            self.assertEqual((done.returncode, done.stdout + done.stderr), (0, ""))

    def test_the_reader_of_metrics_is_strict(self):
        good = "# HELP a_total x\n# TYPE a_total counter\na_total 1\n"
        metrics_text.parse(good)
        for bad in (good[:-1], good + "a_total 2\n", good + "b 1\n", good.replace("counter", "counters"),
                    good.replace("a_total", "a"), good.replace("a_", "aB_"), good.replace(" 1\n", " -1\n"), good.replace(" 1\n", ' {x="1} 1\n'),
                    good.replace("a_total 1", 'a_total{x="1",x="2"} 1'), good + "# TYPE a_total counter\n"):
            with self.assertRaises(ValueError, msg=bad):
                metrics_text.parse(bad)

    def test_every_query_of_the_dashboard_names_what_the_server_exports(self):
        tls = self.folder / "tls.pem"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days",
                        "2", "-subj", "/CN=localhost", "-keyout", tls, "-out", self.folder / "certificate.pem"], check=True,
                       capture_output=True)
        families = metrics_text.parse(self.get(self.solved(), "/metrics")[1])
        families |= metrics_text.parse(self.tlsMetrics(tls))
        dashboard = json.loads(DASHBOARD.read_text())
        queries = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
        queries += [v["query"]["query"] for v in dashboard["templating"]["list"] if v["type"] == "query"]
        self.assertGreater(len(queries), 15)
        for query in queries:
            names = re.findall(r"\bradiosityd_\w+", query)
            self.assertTrue(names, query)
            for name in names:
                self.assertIn(name, families, query)
                if families[name].kind == "counter":
                    self.assertRegex(query, rf"(rate|increase)\({name}")
            labels = {key for samples in (families[name].samples for name in names) for pairs in samples for key, _ in pairs}
            used = set(re.findall(r"(\w+)(?:=~|!~|!=|=)\"", query)) | set(re.findall(r"by \((\w+)\)", query))
            self.assertLessEqual(used - {"instance"}, labels, query)  # a scraper adds `instance`
        for panel in dashboard["panels"]:
            for target in panel["targets"]:
                for label in re.findall(r"\{\{(\w+)\}\}", target["legendFormat"]):
                    name = re.search(r"radiosityd_\w+", target["expr"]).group()
                    known = {key for pairs in families[name].samples for key, _ in pairs} | {"instance"}
                    self.assertIn(label, known, target)

    def tlsMetrics(self, key):
        import ssl
        server = self.server("--tls-cert", self.folder / "certificate.pem", "--tls-key", key)
        trust = ssl._create_unverified_context()
        with urllib.request.urlopen(server.url + "/metrics", timeout=SECONDS, context=trust) as reply:
            return reply.read().decode()

    # ---- probes ----

    def test_a_server_is_healthy_at_once_and_ready_once_it_has_loaded(self):
        server = self.server()
        self.assertEqual(self.get(server, "/healthz"), (200, "ok\n"))
        self.assertEqual(self.get(server, "/readyz"), (200, "ready\n"))

    def test_a_server_that_was_given_a_scene_is_not_ready_before_it_is_there(self):
        server = self.server(self.scene, "--error", "0.1", "--texels", "500")
        revision = 0
        while revision == 0:
            # In this order: what is ready now has been loaded now.
            status, said = self.get(server, "/readyz")
            metrics = metrics_text.parse(self.get(server, "/metrics")[1])
            revision = metrics["radiosityd_scene_revision"].samples[()]
            if revision == 0:
                self.assertEqual((status, said), (503, "loading\n"))

    # ---- logs ----

    def test_json_logs_are_one_object_a_line_with_revision_and_request(self):
        server = self.solved("--log-format", "json")

        async def edit():
            session = await Session.open(server.url)
            patch = [{"op": "replace", "path": f"/materials/{plates.LAMP_MATERIAL}/emissiveFactor", "value": [1, 1, 1]}]
            reply = await session.call("scene.patch", patch=patch, requestId="night \n shift")
            await session.close()
            return reply["revision"]

        revision = asyncio.run(asyncio.wait_for(edit(), SECONDS))
        self.assertEqual(server.terminate(), 0)
        lines = [json.loads(line) for line in server.log().splitlines()]
        for line in lines:
            self.assertLessEqual({"time", "level", "program", "message"}, set(line))
            self.assertLessEqual(set(line), {"time", "level", "program", "message", "revision", "requestId"})
        edits = [line for line in lines if line.get("requestId") == "night \n shift"]
        self.assertEqual([line["revision"] for line in edits], [revision])
        self.assertTrue(any("draining" in line["message"] for line in lines))

    # ---- systemd ----

    def manager(self):
        """A socket as systemd gives it, and the environment that names it."""
        place = self.folder / "notify"
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        listener.bind(str(place))
        listener.settimeout(SECONDS)
        self.addCleanup(listener.close)
        return listener, {"NOTIFY_SOCKET": str(place)}

    def heard(self, listener, wanted):
        """Messages up to the one that matches."""
        messages = []
        while not messages or not re.search(wanted, messages[-1]):
            messages.append(listener.recv(4096).decode())
        return messages

    def test_systemd_is_told_of_start_status_life_and_end(self):
        listener, environment = self.manager()
        server = self.server(self.scene, "--error", "0.1", "--texels", "500", env={**environment, "WATCHDOG_USEC": "300000"})
        self.assertEqual(self.heard(listener, "READY=1"), ["READY=1"])
        self.heard(listener, r"STATUS=converged, revision 1, error [\d.e-]+ %, 0 viewers")
        for _ in range(3):
            self.heard(listener, "^WATCHDOG=1$")
        server.process.send_signal(signal.SIGTERM)
        self.assertIn("STATUS=", self.heard(listener, "STOPPING=1")[-1])
        self.assertEqual(server.wait(SECONDS), 0)

    def test_an_abstract_socket_is_spoken_to_as_well(self):
        name = f"radiosity-test-{os.getpid()}-{time.monotonic_ns()}"
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        listener.bind("\0" + name)
        listener.settimeout(SECONDS)
        self.addCleanup(listener.close)
        self.server(env={"NOTIFY_SOCKET": "@" + name})
        self.assertEqual(listener.recv(100), b"READY=1")

    def test_without_a_watchdog_none_is_fed(self):
        listener, environment = self.manager()
        for extra in ({}, {"WATCHDOG_USEC": "300000", "WATCHDOG_PID": "1"}):
            server = self.server(env={**environment, **extra})
            self.heard(listener, "STATUS=")
            server.process.send_signal(signal.SIGTERM)
            self.assertNotIn("WATCHDOG=1", self.heard(listener, "STOPPING=1"))
            server.wait(SECONDS)

    def test_a_manager_that_is_not_there_does_not_matter(self):
        server = self.solved(env={"NOTIFY_SOCKET": str(self.folder / "nobody"), "WATCHDOG_USEC": "300000"})
        self.until(lambda: "NOTIFY_SOCKET" in server.log())
        self.assertEqual(server.terminate(), 0)
        self.assertEqual(server.log().count("NOTIFY_SOCKET"), 1)

    def test_a_manager_that_does_not_read_does_not_hold_up_the_end(self):
        _, environment = self.manager()
        server = self.server(env={**environment, "WATCHDOG_USEC": "3000"})  # its queue is full at once
        self.until(lambda: "nobody reads it" in server.log())
        self.assertEqual(server.terminate(), 0)


if __name__ == "__main__":
    unittest.main()
