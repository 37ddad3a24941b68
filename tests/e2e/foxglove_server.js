// A Foxglove WebSocket server, using Foxglove's own library: prints its port, then sends a message
// for each line of standard input.
//   {"topic": "/a", "update": {…}}   a foxglove.SceneUpdate, as protobuf or JSON as its topic is
//   {"topic": "/a", "bytes": "…"}    these bytes (base64) in its place
// The first argument is a file of the messages' definitions; NODE_PATH has the packages.
"use strict";

const readline = require("node:readline");
const { FoxgloveServer } = require("@foxglove/ws-protocol");
const protobuf = require("protobufjs");
const { WebSocketServer } = require("ws");

const SceneUpdate = protobuf.loadSync(process.argv[2]).lookupType("foxglove.SceneUpdate");
const server = new FoxgloveServer({ name: "test" });
const sockets = new WebSocketServer({ host: "127.0.0.1", port: 0, handleProtocols: (names) => server.handleProtocols(names) });
sockets.on("connection", (socket, request) => server.handleConnection(socket, request.socket.remoteAddress));
sockets.on("listening", () => console.log(JSON.stringify({ port: sockets.address().port })));
server.on("subscribe", (id) => console.log(JSON.stringify({ subscribed: id })));

const channels = new Map();
for (const [topic, encoding, schemaName] of [
  ["/shapes", "protobuf", "foxglove.SceneUpdate"],
  ["/words", "json", "foxglove.SceneUpdate"],
  ["/tf", "protobuf", "foxglove.FrameTransform"],
]) {
  channels.set(topic, { encoding, id: server.addChannel({ topic, encoding, schemaName, schema: "" }) });
}

readline.createInterface({ input: process.stdin }).on("line", (line) => {
  const { topic, update, bytes } = JSON.parse(line);
  const { encoding, id } = channels.get(topic);
  const payload =
    bytes !== undefined ? Buffer.from(bytes, "base64")
    : encoding === "json" ? Buffer.from(JSON.stringify(update))
    : SceneUpdate.encode(SceneUpdate.fromObject(update)).finish();
  server.sendMessage(id, BigInt(Date.now()) * 1000000n, payload);
}).on("close", () => process.exit(0));
