"""A WebSocket client as bytes on a TCP connection: it can do everything that the protocol forbids."""
import base64
import json
import os
import socket
import struct

CONTINUATION, TEXT, BINARY, CLOSE, PING, PONG = 0, 1, 2, 8, 9, 10
PATIENCE = 20  # seconds until a test fails that waits for what does not come


def frame(opcode, payload=b"", fin=True, rsv=0, masked=True):
    """One frame (RFC 6455, section 5.2)."""
    head = bytes([(0x80 if fin else 0) | rsv << 4 | opcode])
    size, bit = len(payload), 0x80 if masked else 0
    if size < 126:
        head += bytes([bit | size])
    elif size < 1 << 16:
        head += bytes([bit | 126]) + struct.pack(">H", size)
    else:
        head += bytes([bit | 127]) + struct.pack(">Q", size)
    if not masked:
        return head + payload
    key = os.urandom(4)
    # As one long number: a loop over a megabyte would be the slowest part of the test.
    stream = int.from_bytes((key * (size // 4 + 1))[:size], "big") ^ int.from_bytes(payload, "big")
    return head + key + stream.to_bytes(size, "big")


def close_payload(code, reason=b""):
    return struct.pack(">H", code) + reason


class RawSocket:
    """A TCP connection to the server; upgrade() makes it a WebSocket, hello() a viewer."""

    def __init__(self, port, receive_buffer=None):
        self.socket = socket.socket()
        if receive_buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(PATIENCE)
        self.socket.connect(("127.0.0.1", port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.buffer, self.port = b"", port

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def reset(self):
        """Ends it with RST in place of FIN."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        self.socket.close()

    def send(self, data, chop=None):
        """All of it, in pieces of `chop` bytes. A peer that has closed meanwhile shows when reading."""
        try:
            for i in range(0, len(data), chop or max(1, len(data))):
                self.socket.sendall(data[i:i + (chop or len(data))])
        except OSError:
            pass

    def upgrade(self, *headers):
        """Returns the response's head."""
        lines = ["GET /ws HTTP/1.1", f"Host: 127.0.0.1:{self.port}", "Upgrade: websocket", "Connection: Upgrade",
                 f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}", "Sec-WebSocket-Version: 13",
                 "Sec-WebSocket-Protocol: radiosity.v1", *headers]
        self.send("\r\n".join(lines + ["", ""]).encode())
        while b"\r\n\r\n" not in self.buffer:
            self._more()
        head, self.buffer = self.buffer.split(b"\r\n\r\n", 1)
        return head.decode()

    def hello(self, **params):
        return self.call("hello", client="raw", **params)

    def call(self, method, **params):
        """Sends a request and returns its result; notifications and tiles that come first are dropped."""
        self.send(frame(TEXT, json.dumps({"jsonrpc": "2.0", "id": method, "method": method, "params": params}).encode()))
        return self.answer(method)["result"]

    def answer(self, request):
        """The response to the request of that id; others and everything else are dropped, pings too: the server may send
        one at any time, and will on a machine that is busy."""
        while True:
            _, opcode, payload = self.frame()
            assert opcode in (TEXT, BINARY, PING), (opcode, payload)
            if opcode == TEXT and "method" not in (message := json.loads(payload)) and message["id"] == request:
                return message

    def _more(self):
        chunk = self.socket.recv(1 << 16)
        if not chunk:
            raise EOFError
        self.buffer += chunk

    def _take(self, count):
        while len(self.buffer) < count:
            self._more()
        taken, self.buffer = self.buffer[:count], self.buffer[count:]
        return taken

    def frame(self):
        """The next frame: (fin, opcode, payload). EOFError or ConnectionError: the connection has ended."""
        first, second = self._take(2)
        assert first & 0x70 == 0, "the server sets no reserved bit"
        assert second & 0x80 == 0, "the server does not mask"
        size = second
        if size == 126:
            size, = struct.unpack(">H", self._take(2))
        elif size == 127:
            size, = struct.unpack(">Q", self._take(8))
        return bool(first & 0x80), first & 15, self._take(size)

    def reply(self):
        """The next frame that is no notification, no tile and no ping."""
        while True:
            got = self.frame()
            if got[1] in (BINARY, PING) or (got[1] == TEXT and b'"method"' in got[2]):
                continue
            return got

    def end(self):
        """Reads to the end. The close code that came; 0: a close frame without one; None: no close frame."""
        code = None
        try:
            while True:
                _, opcode, payload = self.frame()
                if opcode == CLOSE:
                    code = struct.unpack(">H", payload[:2])[0] if payload else 0
        except (EOFError, ConnectionError):
            return code
