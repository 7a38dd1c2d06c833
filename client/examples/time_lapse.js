// Moves a thing along a line and records a time-lapse: node time_lapse.js [HOST:PORT [NODE [FRAMES [METRES]]]]. Needs ws (node-ws).
const { WebSocket } = require("ws");
const { writeFile } = require("fs/promises");

async function main(server = "127.0.0.1:8765", node = "short_block", frames = 24, metres = 0.1) {
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
  await call("hello", { client: "time_lapse.js" });
  const { nodes } = await (await fetch(`http://${server}/scene.gltf`)).json();
  const there = nodes.find(({ name }) => name === node);
  if (!there) throw new Error(`no node is named '${node}'`);
  const [x, y, z] = there.translation;
  let exposure; // the first picture measures it; a film does not flicker
  for (let frame = 0; frame < frames; frame++) {
    const value = [x + (metres * frame) / frames, y, z];
    const edit = await call("scene.patch", { patch: [{ op: "replace", path: `/nodes/@${node}/translation`, value }] });
    await call("solve.wait", { error: 0.05, revision: edit.revision });
    const picture = await call("snapshot", { width: 640, height: 480, exposure });
    exposure = picture.exposure;
    const png = await (await fetch(`http://${server}${picture.url}`)).arrayBuffer();
    await writeFile(`frame-${String(frame).padStart(3, "0")}.png`, Buffer.from(png));
    console.log(`frame-${String(frame).padStart(3, "0")}.png`);
  }
  socket.close();
}
main(...process.argv.slice(2)).catch((error) => { console.error(error.message); process.exit(1); });
