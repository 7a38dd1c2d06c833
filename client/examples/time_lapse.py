#!/usr/bin/env python3
"""Moves a thing along a circle and records a time-lapse: time_lapse.py [HOST:PORT [NODE [FRAMES [RADIUS]]]]"""
import asyncio, json, math, sys, urllib.request
import websockets

async def main(server="127.0.0.1:8765", node="short_block", frames="24", radius="0.05"):
    async with websockets.connect(f"ws://{server}/ws", subprotocols=["radiosity.v1"]) as socket:
        async def call(method, **params):
            await socket.send(json.dumps({"jsonrpc": "2.0", "id": method, "method": method, "params": params}))
            while (message := json.loads(await socket.recv())).get("id") != method:
                pass  # notifications, such as progress
            if "error" in message:
                sys.exit(f"{method}: {message['error']['message']}")
            return message["result"]

        await call("hello", client="time_lapse.py")
        with urllib.request.urlopen(f"http://{server}/scene.gltf") as file:
            places = [n["translation"] for n in json.load(file)["nodes"] if n.get("name") == node]
        if not places:
            sys.exit(f"no node is named '{node}'")
        x, y, z = places[0]
        exposure = {}  # the first picture measures it; a film does not flicker
        for frame in range(int(frames)):
            t = 2 * math.pi * frame / int(frames)
            there = [x + float(radius) * (math.cos(t) - 1), y, z + float(radius) * math.sin(t)]
            edit = await call("scene.patch", patch=[{"op": "replace", "path": f"/nodes/@{node}/translation", "value": there}])
            await call("solve.wait", error=0.05, revision=edit["revision"])
            picture = await call("snapshot", width=640, height=480, **exposure)
            urllib.request.urlretrieve(f"http://{server}{picture['url']}", f"frame-{frame:03}.png")
            exposure = {"exposure": picture["exposure"]}
            print(f"frame-{frame:03}.png", flush=True)

asyncio.run(main(*sys.argv[1:]))
