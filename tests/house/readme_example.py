"""Runs the script that README.md shows, word for word, against a server of its own; only the address is another.
Usage: readme_example.py RADIOSITYD SCENE. Exit status 77: skipped."""

import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

README = Path(__file__).resolve().parents[2] / "README.md"
START_S, SCRIPT_S, STOP_S = 60, 240, 20
PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"


def example():
    blocks = re.findall(r"^```python\n(.*?)^```$", README.read_text(encoding="utf-8"), re.M | re.S)
    assert len(blocks) == 1, f"README.md holds {len(blocks)} Python examples; this test expects one"
    return blocks[0]


def listening_address(server):
    """The address in the server's "listening on http://HOST:PORT"; its other output goes to our log."""
    for line in server.stdout:
        print("radiosityd:", line, end="")
        found = re.search(r"listening on http://([^\s/]+)", line)
        if found:
            threading.Thread(target=lambda: [print("radiosityd:", rest, end="") for rest in server.stdout], daemon=True).start()
            return found.group(1)
    raise AssertionError(f"radiosityd ended with {server.wait()} before it listened")


def main(program, scene):
    try:
        import websockets  # noqa: F401
    except ImportError:
        print(f"skipped: {sys.executable} has no module websockets (package python3-websockets)")
        return 77
    server = subprocess.Popen([program, scene, "--listen", "127.0.0.1:0"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True)
    watchdog = threading.Timer(START_S, server.kill)
    watchdog.start()
    try:
        address = listening_address(server)
        watchdog.cancel()
        script = example()
        assert script.count('"127.0.0.1:8765"') == 1, "the example names the server's address once"
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, "-c", script.replace("127.0.0.1:8765", address)], cwd=folder, check=True,
                           timeout=SCRIPT_S)
            made = os.listdir(folder)
            assert made == ["blue.png"], f"the example wrote {made}"
            assert Path(folder, "blue.png").read_bytes().startswith(PNG_SIGNATURE), "blue.png is not a PNG file"
        server.send_signal(signal.SIGTERM)
        status = server.wait(STOP_S)
        assert status == 0, f"radiosityd ended with {status} after SIGTERM"
    finally:
        watchdog.cancel()
        server.kill()
        server.wait()
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
