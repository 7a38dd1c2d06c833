#!/usr/bin/env python3
"""Lights a scene in 20 colours and saves 20 pictures: sweep_lamp.py [HOST:PORT [MATERIAL]]"""
import asyncio, colorsys, json, sys, urllib.request
import websockets

async def main(server="127.0.0.1:8765", material="light"):
    async with websockets.connect(f"ws://{server}/ws", subprotocols=["radiosity.v1"]) as socket:
        async def call(method, **params):
            await socket.send(json.dumps({"jsonrpc": "2.0", "id": method, "method": method, "params": params}))
            while (message := json.loads(await socket.recv())).get("id") != method:
                pass  # notifications, such as progress
            if "error" in message:
                sys.exit(f"{method}: {message['error']['message']}")
            return message["result"]

        await call("hello", client="sweep_lamp.py")
        exposure = {}  # the first picture measures it; the others are to be compared with it
        for i in range(20):
            color = colorsys.hsv_to_rgb(i / 20, 0.8, 1.0)
            path = f"/materials/@{material}/emissiveFactor"
            edit = await call("scene.patch", patch=[{"op": "replace", "path": path, "value": color}])
            await call("solve.wait", error=0.05, revision=edit["revision"])
            picture = await call("snapshot", width=640, height=480, **exposure)
            urllib.request.urlretrieve(f"http://{server}{picture['url']}", f"sweep-{i:02}.png")
            exposure = {"exposure": picture["exposure"]}
            print(f"sweep-{i:02}.png", flush=True)

asyncio.run(main(*sys.argv[1:]))
