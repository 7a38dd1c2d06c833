"""Starts the real programs for the service tests and sees to it that none is left behind."""
import os
import pathlib
import re
import select
import shutil
import signal
import subprocess
import tempfile
import time
import unittest
import unittest.mock
import uuid

from patience import PATIENCE

MARK = "RADIOSITY_TEST_MARK"
# Most tests name how many texels they want and reckon with that many; a test of chosen texels names CHOSEN.
CHOSEN = "--chosen-texels"


def with_texels(arguments):
    """Texels of one size, unless CHOSEN says that the program is to choose them."""
    words = [str(argument) for argument in arguments]
    return [word for word in words if word != CHOSEN] if CHOSEN in words else [*words, "--uniform"]


def program(variable):
    """Path of a program that ctest names in the environment; a missing one is a failure."""
    path = os.environ.get(variable)
    if not path:
        raise AssertionError(f"{variable} must name the program to test (ctest sets it)")
    if not os.access(path, os.X_OK):
        raise AssertionError(f"{path} is missing: build it first")
    return path


class Server:
    """A radiosityd on a free port (or `port`). Its log goes to a file, so that a full pipe never blocks it."""

    def __init__(self, folder, *arguments, mark, port=0, env=None):
        self.log_path = pathlib.Path(folder) / f"radiosityd-{uuid.uuid4().hex}.log"
        with open(self.log_path, "wb") as log:
            self.process = subprocess.Popen(
                [program("RADIOSITYD"), "--listen", f"127.0.0.1:{port}", *with_texels(arguments)],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, env={**os.environ, **(env or {}), MARK: mark})
        self.url = self._listening_url(180 * PATIENCE)

    def _listening_url(self, seconds):
        text, deadline = b"", time.monotonic() + seconds
        while time.monotonic() < deadline:
            if select.select([self.process.stdout], [], [], 0.1)[0]:
                chunk = os.read(self.process.stdout.fileno(), 4096)
                if not chunk:
                    break
                text += chunk
                found = re.search(rb"listening on (https?://\S+)", text)
                if found:
                    return found.group(1).decode()
        code = self.kill()
        raise AssertionError(f"radiosityd did not listen (status {code}): {self.log()}")

    @property
    def port(self):
        return int(self.url.rsplit(":", 1)[1])

    def log(self):
        return self.log_path.read_text(errors="replace")

    def workers(self):
        """Numbers of its renderer processes, ascending. Looked for among all, since a thread's children have another
        parent thread once it ends."""
        found = []
        for entry in pathlib.Path("/proc").iterdir():
            try:
                if entry.name.isdigit() and b"--worker" in (entry / "cmdline").read_bytes():
                    stat = (entry / "stat").read_text().rsplit(")", 1)[1].split()
                    if int(stat[1]) == self.process.pid and stat[0] != "Z":
                        found.append(int(entry.name))
            except OSError:
                continue  # it has ended
        return sorted(found)

    def terminate(self, seconds=60):
        """SIGTERM; returns the exit status."""
        self.process.send_signal(signal.SIGTERM)
        return self.wait(seconds)

    def wait(self, seconds):
        code = self.process.wait(seconds)
        self.process.stdout.close()
        return code

    def kill(self):
        if self.process.poll() is None:
            self.process.kill()
        code = self.process.wait()
        self.process.stdout.close()
        return code


def marked_processes(mark):
    """Command lines of running processes whose environment carries the mark: ours and whatever they started."""
    found = []
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            if f"{MARK}={mark}".encode() in (entry / "environ").read_bytes().split(b"\0"):
                found.append((entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace"))
        except OSError:
            continue  # it has ended, or is not ours to read
    return found


def sanitizer_options(folder):
    """The options of those sanitizers that the environment speaks of, with reports that go to files in `folder`."""
    return {name: f"{os.environ[name]}:log_path={folder}/report" for name in ("ASAN_OPTIONS", "TSAN_OPTIONS")
            if name in os.environ}


class ServiceCase(unittest.TestCase):
    """A folder, a mark on every process, and the claim that all are gone in the end, and no sanitizer had a word to say."""

    maxDiff = None

    def setUp(self):
        self.mark = uuid.uuid4().hex
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="radiosity-service-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self._watchSanitizers()
        self.addCleanup(self.assertNothingLeft)

    def _watchSanitizers(self):
        # Not every status is looked at: a renderer that ends is replaced, and many a server is killed in the end.
        reports = pathlib.Path(tempfile.mkdtemp(prefix="radiosity-sanitizers-"))
        self.addCleanup(shutil.rmtree, reports, ignore_errors=True)
        self.addCleanup(self.assertNoReports, reports)
        options = unittest.mock.patch.dict(os.environ, sanitizer_options(reports))
        options.start()
        self.addCleanup(options.stop)

    def assertNoReports(self, reports):
        found = [file.read_text(errors="replace") for file in reports.iterdir()]
        # Those of GCC's undefined-behaviour sanitizer go to standard error, whatever its options say.
        found += [log for file in self.folder.glob("*.log") if "runtime error: " in (log := file.read_text(errors="replace"))]
        if found:
            self.fail("\n".join(found))

    def server(self, *arguments, **options):
        server = Server(self.folder, *arguments, mark=self.mark, **options)
        self.addCleanup(server.kill)
        return server

    def assertNothingLeft(self, seconds=60.0 * PATIENCE):
        deadline = time.monotonic() + seconds
        while marked_processes(self.mark) and time.monotonic() < deadline:
            time.sleep(0.05)
        self.assertEqual(marked_processes(self.mark), [])

    @staticmethod
    def words(arguments):
        """The client's arguments."""
        return with_texels(arguments) if arguments[:1] == ("solve",) else [*map(str, arguments)]

    def start(self, *arguments, env=None, stdin=subprocess.DEVNULL):
        """The client, running."""
        process = subprocess.Popen([program("RADIOSITY"), *self.words(arguments)], stdin=stdin, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True, env={**os.environ, **(env or {}), MARK: self.mark},
                                   cwd=self.folder)

        def end():
            if process.poll() is None:
                process.kill()
            process.wait()
            for pipe in (process.stdout, process.stderr):
                pipe.close()

        self.addCleanup(end)
        return process

    def client(self, *arguments, expect=0, env=None, stdin=None, seconds=300 * PATIENCE):
        """Runs the client to its end; returns (stdout, stderr)."""
        done = subprocess.run([program("RADIOSITY"), *self.words(arguments)], capture_output=True, text=True,
                              input=stdin or "", env={**os.environ, **(env or {}), MARK: self.mark}, cwd=self.folder,
                              timeout=seconds, check=False)
        self.assertEqual(done.returncode, expect, f"{arguments}\nstdout: {done.stdout}\nstderr: {done.stderr}")
        return done.stdout, done.stderr

    def complaint(self, *arguments, expect=2, **options):
        """The client must fail with just one line that says why; returns it."""
        _, errors = self.client(*arguments, expect=expect, **options)
        lines = [line for line in errors.splitlines() if "error:" in line]
        self.assertEqual(len(lines), 1, errors)
        return lines[0]

    def files(self):
        return sorted(p.name for p in self.folder.iterdir() if p.suffix != ".log")


def waitForLine(stream, wanted, seconds=120 * PATIENCE):
    """Reads lines of a child's pipe until one contains `wanted`; returns everything read."""
    text, deadline = "", time.monotonic() + seconds
    while time.monotonic() < deadline:
        if not select.select([stream], [], [], 0.1)[0]:
            continue
        chunk = os.read(stream.fileno(), 4096).decode(errors="replace")
        if not chunk:
            break
        text += chunk
        if wanted in text:
            return text
    raise AssertionError(f"never saw {wanted!r} in {text!r}")
