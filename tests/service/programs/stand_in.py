"""Something that answers in a server's place, and does what a real one does only by chance."""
import asyncio
import concurrent.futures
import contextlib
import json
import pathlib
import struct
import threading

import websockets

EXAMPLES = pathlib.Path(__file__).resolve().parents[3] / "protocol" / "examples"


def example(name):
    """A message of the specification."""
    return json.loads((EXAMPLES / f"{name}.json").read_text())


async def messages(socket):
    """Until the client goes, with a close frame or without."""
    with contextlib.suppress(websockets.ConnectionClosed):
        while True:
            yield await socket.recv()


@contextlib.contextmanager
def running(serve):
    """Runs `serve(told)` in another thread, which gives the future `told` its port; ends it in the end."""
    told = concurrent.futures.Future()
    loop = asyncio.new_event_loop()
    task = loop.create_task(serve(told))
    thread = threading.Thread(target=lambda: loop.run_until_complete(asyncio.wait([task])))
    thread.start()
    try:
        yield told.result(20)
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join()
        loop.close()


class Frames:
    """The server's end of a WebSocket on a pair of streams: for one that answers HTTP on the same port."""

    def __init__(self, reader, writer):
        self.reader, self.writer = reader, writer

    def send(self, opcode, payload):
        size = len(payload)
        self.writer.write(bytes([0x80 | opcode]) + (bytes([size]) if size < 126 else b"\x7e" + struct.pack(">H", size)) + payload)

    async def receive(self):
        """(opcode, payload) of the next frame; asyncio.IncompleteReadError at the end."""
        first, second = await self.reader.readexactly(2)
        size = second & 127
        if size > 125:
            size = int.from_bytes(await self.reader.readexactly(2 if size == 126 else 8), "big")
        mask, payload = await self.reader.readexactly(4), await self.reader.readexactly(size)
        return first & 15, bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))
