// Dims a lamp in 20 steps and saves 20 pictures: node sweep_lamp.js [HOST:PORT [MATERIAL]]. Needs the package ws (node-ws).
const { WebSocket } = require("ws");
const { writeFile } = require("fs/promises");

async function main(server = "127.0.0.1:8765", material = "light") {
  const socket = new WebSocket(`ws://${server}/ws`, "radiosity.v1");
  const waiting = new Map();
  socket.on("message", (data) => {
    const { id, result, error } = JSON.parse(data); // notifications have no id
    waiting.get(id)?.(error ? Promise.reject(new Error(error.message)) : result);
  });
  let next = 1;
  const call = (method, params) => new Promise((done) => {
    waiting.set(next, done);
    socket.send(JSON.stringify({ jsonrpc: "2.0", id: next++, method, params }));
  });
  await new Promise((open, fail) => socket.once("open", open).once("error", fail));
  await call("hello", { client: "sweep_lamp.js" });
  let exposure; // the first picture measures it; the others are to be compared with it
  for (let i = 0; i < 20; i++) {
    const path = `/materials/@${material}/emissiveFactor`;
    const edit = await call("scene.patch", { patch: [{ op: "replace", path, value: Array(3).fill(1 - i / 20) }] });
    await call("solve.wait", { error: 0.05, revision: edit.revision });
    const picture = await call("snapshot", { width: 640, height: 480, exposure });
    exposure = picture.exposure;
    const name = `sweep-${String(i).padStart(2, "0")}.png`;
    await writeFile(name, Buffer.from(await (await fetch(`http://${server}${picture.url}`)).arrayBuffer()));
    console.log(name);
  }
  socket.close();
}
main(...process.argv.slice(2)).catch((error) => { console.error(error.message); process.exit(1); });
