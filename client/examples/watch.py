#!/usr/bin/env python3
"""Follows a solve with nothing but the `websockets` package: watch.py [ws://127.0.0.1:8765/ws]"""
import asyncio, json, sys
import websockets

async def watch(url):
    async with websockets.connect(url, subprotocols=["radiosity.v1"]) as server:
        await server.send(json.dumps({"jsonrpc": "2.0", "id": 1, "method": "hello", "params": {"client": "watch.py"}}))
        async for message in server:
            note = json.loads(message)
            if note.get("method") == "progress":
                p = note["params"]
                print(f"{p['state']}: error {100 * p['error']['total']:.2f} %, {p['shots']} shots", flush=True)

asyncio.run(watch(sys.argv[1] if len(sys.argv) > 1 else "ws://127.0.0.1:8765/ws"))
