"""radiosity.v1 from its specification alone, on the `websockets` package: what a stranger's client would look like."""
import asyncio
import json
import struct
import zlib

import websockets

from patience import PATIENCE

HEADER = struct.Struct("<4sBBBBIHHIIHHiQQIfII")
RGBA16F, RGBA32F, R32UI = 0, 2, 3


def _crc32c_table():
    table = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        table.append(byte)
    return table


_TABLE = _crc32c_table()


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


class Tile:
    """One binary frame, every field checked."""

    def __init__(self, frame):
        assert HEADER.size == 64 and len(frame) >= 64, len(frame)
        (magic, version, self.kind, self.format, self.codec, self.page, self.mip, self.flags, self.x, self.y, self.width,
         self.height, self.exponent, self.revision, self.version, self.shots, self.error, size,
         crc) = HEADER.unpack_from(frame)
        assert magic == b"RADT" and version == 1, (magic, version)
        payload = frame[64:]
        assert len(payload) == size, (len(payload), size)
        assert 1 <= self.width <= 64 and 1 <= self.height <= 64, (self.width, self.height)
        assert self.x % 64 == 0 and self.y % 64 == 0, (self.x, self.y)
        raw = zlib.decompress(payload) if self.codec == 1 else payload
        pixel = {RGBA16F: "<4e", RGBA32F: "<4f", R32UI: "<I"}[self.format]
        assert len(raw) == self.width * self.height * struct.calcsize(pixel), len(raw)
        assert crc32c(raw) == crc, "CRC-32C"
        scale = 2.0 ** self.exponent if self.format != R32UI else 1
        self.pixels = [tuple(v * scale for v in p[:3]) for p in struct.iter_unpack(pixel, raw)]


class RpcError(Exception):
    def __init__(self, error):
        super().__init__(f"{error['code']}: {error['message']}")
        self.code, self.data = error["code"], error.get("data", {})


class Session:
    """A connection: calls by name, notifications and tiles collected as they come."""

    def __init__(self, socket):
        self.socket, self.next_id, self.notes, self.tiles = socket, 1, [], []

    @staticmethod
    async def open(url, **hello):
        # A session that its test leaves open ends with the loop, which would wait for ten seconds.
        socket = await websockets.connect(url.replace("http://", "ws://") + "/ws", subprotocols=["radiosity.v1"],
                                          max_size=1 << 20, compression=None, close_timeout=0.2)
        session = Session(socket)
        assert socket.subprotocol == "radiosity.v1", socket.subprotocol
        session.info = (await session.note("serverInfo"))["params"]
        offer = {"client": "service test", "tileFormats": ["rgba16f"], "codecs": ["deflate", "none"], "creditBytes": 1 << 20}
        session.hello = await session.call("hello", **{**offer, **hello})
        return session

    async def close(self):
        await self.socket.close()

    async def receive(self, seconds=120 * PATIENCE):
        """One message, put where it belongs; responses and errors are returned."""
        frame = await asyncio.wait_for(self.socket.recv(), seconds)
        if isinstance(frame, bytes):
            self.tiles.append(Tile(frame))
            await self.socket.send(json.dumps({"jsonrpc": "2.0", "method": "credit", "params": {"bytes": len(frame)}}))
            return None
        message = json.loads(frame)
        if "method" in message:
            self.notes.append(message)
            return None
        return message

    async def call(self, method, **params):
        self.next_id += 1
        request = self.next_id
        await self.socket.send(json.dumps({"jsonrpc": "2.0", "id": request, "method": method, "params": params}))
        while True:
            answer = await self.receive()
            if answer is None:
                continue
            assert answer.get("id") == request, answer
            if "error" in answer:
                raise RpcError(answer["error"])
            return answer["result"]

    async def raw(self, text):
        """Sends any text; returns the answer."""
        await self.socket.send(text)
        while True:
            answer = await self.receive()
            if answer is not None:
                return answer

    async def note(self, method, seconds=120 * PATIENCE):
        """The next notification of that kind, past or future; so long at most without any message."""
        while True:
            for i, note in enumerate(self.notes):
                if note["method"] == method:
                    return self.notes.pop(i)
            answer = await self.receive(seconds)
            assert answer is None, answer

    async def tiles_until(self, version):
        """Receives until a bookmark says that everything up to this tile version has been sent."""
        while (await self.note("bookmark"))["params"]["tileVersion"] < version:
            pass
