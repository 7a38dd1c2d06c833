"""Writers that edit a server without pause, and a ledger of what they were promised: what was acknowledged must still
be there after the server was killed. Used by a test, and by the benchmark that kills a thousand times."""
import asyncio
import time
import urllib.error
import urllib.request

import websockets

import plates
from wire import RpcError, Session

WRITERS = 4
STRENGTH = "/materials/@lamp/extensions/KHR_materials_emissive_strength/emissiveStrength"
GONE = (OSError, asyncio.TimeoutError, websockets.WebSocketException)


def scene_with_counters():
    """Each writer counts up a number of its own in the document."""
    scene = plates.lit_document()
    scene["extras"] = {f"w{writer}": 0 for writer in range(WRITERS)}
    return scene


def ready_seconds(url, started, patience=60):
    """Seconds from `started` until the server says that it is ready."""
    while time.monotonic() < started + patience:
        try:
            with urllib.request.urlopen(url + "/readyz", timeout=5) as answer:
                if answer.status == 200:
                    return time.monotonic() - started
        except urllib.error.HTTPError:
            pass
        time.sleep(0.005)
    raise AssertionError("the server never became ready")


class Ledger:
    def __init__(self):
        self.sent = [0] * WRITERS
        self.acknowledged = [0] * WRITERS
        self.answers = {}  # by requestId
        self.doubtful = [None] * WRITERS  # sent, never answered
        self.revision = 0  # highest acknowledged
        self.epoch = None
        self.latencies = []

    def edit(self, writer):
        """The next edit of a writer: often its counter alone, now and then light or geometry as well."""
        count = self.sent[writer] = self.sent[writer] + 1
        patch = [{"op": "replace", "path": f"/extras/w{writer}", "value": count}]
        if count % 3 == 0:
            patch.append({"op": "replace", "path": STRENGTH, "value": 5 + count % 7})
        if count % 20 == 0:
            patch.append({"op": "replace", "path": "/nodes/@lamp/translation", "value": [0, 0.01 * (count % 9), 0]})
        return {"requestId": f"writer-{writer}-{count}", "patch": patch}

    def acknowledge(self, writer, call, result):
        known = self.answers.setdefault(call["requestId"], result)
        assert known == result, f"{call['requestId']} was answered with {known}, and later with {result}"
        self.doubtful[writer] = None
        self.acknowledged[writer] = self.sent[writer]
        self.revision = max(self.revision, result["revision"])

    @property
    def total(self):
        return sum(self.acknowledged)

    async def write(self, url, writer):
        """Edits until the connection breaks."""
        try:
            session = await Session.open(url)
            while True:
                call = self.doubtful[writer] = self.edit(writer)
                begun = time.monotonic()
                result = await session.call("scene.patch", **call)
                self.latencies.append(time.monotonic() - begun)
                self.acknowledge(writer, call, result)
        except GONE:
            return

    async def check(self, url):
        """All that was promised is there; what was in doubt is decided. Returns how many acknowledged edits are lost."""
        session = await Session.open(url)
        assert self.epoch in (None, session.info["epoch"]), "another epoch"
        self.epoch = session.info["epoch"]
        scene = await session.call("scene.get")
        assert scene["revision"] >= self.revision, f"at revision {scene['revision']}, {self.revision} was acknowledged"
        counters = [scene["gltf"]["extras"][f"w{writer}"] for writer in range(WRITERS)]
        lost = sum(max(0, promised - found) for promised, found in zip(self.acknowledged, counters))
        for found, sent in zip(counters, self.sent):
            assert found <= sent, "an edit that nobody made"
        for writer in range(WRITERS):
            await self._ask_again(session, writer)
        scene = await session.call("scene.get")
        for writer in range(WRITERS):
            assert scene["gltf"]["extras"][f"w{writer}"] == self.sent[writer]
        await session.close()
        return lost

    async def _ask_again(self, session, writer):
        """The last acknowledged edit and the one in doubt, once more: no edit is made twice."""
        last = f"writer-{writer}-{self.acknowledged[writer]}"
        call = self.doubtful[writer]
        if last in self.answers and call is None:
            revision = (await session.call("scene.get"))["revision"]
            self.sent[writer] -= 1
            again = await session.call("scene.patch", **self.edit(writer))
            assert again == self.answers[last], f"{last} was answered with {self.answers[last]}, and now with {again}"
            assert (await session.call("scene.get"))["revision"] == revision, f"{last} was made twice"
        if call is not None:
            first = await session.call("scene.patch", **call)
            assert first == await session.call("scene.patch", **call)
            self.acknowledge(writer, call, first)


async def load_for(ledger, url, seconds, end):
    """All writers at work; `end` is called after so long. Returns when every connection has broken."""
    writers = [asyncio.create_task(ledger.write(url, writer)) for writer in range(WRITERS)]
    await asyncio.sleep(seconds)
    end()
    await asyncio.gather(*writers)


__all__ = ["Ledger", "RpcError", "load_for", "ready_seconds", "scene_with_counters"]
