"""Something that answers in a server's place, and does what a real one does only by chance."""
import asyncio
import concurrent.futures
import contextlib
import json
import pathlib
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
