// Reads a recording with another implementation: by its index, with every CRC checked, and with
// messages decoded by the schemas that the file itself has. Prints one JSON object. Its argument is
// the file; NODE_PATH has the packages.
"use strict";

const fs = require("node:fs");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { decompress } = require("fzstd");
const protobuf = require("protobufjs");
const descriptor = require("protobufjs/ext/descriptor");

const decompressHandlers = { zstd: (bytes) => decompress(bytes) };

class File {
  constructor(path) {
    this.descriptor = fs.openSync(path);
  }
  async size() {
    return BigInt(fs.fstatSync(this.descriptor).size);
  }
  async read(offset, length) {
    const bytes = new Uint8Array(Number(length));
    const got = fs.readSync(this.descriptor, bytes, 0, bytes.length, Number(offset));
    if (got !== bytes.length) throw new Error(`${got} of ${bytes.length} bytes at ${offset}`);
    return bytes;
  }
}

function decoder(schema) {
  if (schema.encoding !== "protobuf") throw new Error(`the schema ${schema.name} is ${schema.encoding}`);
  const files = descriptor.FileDescriptorSet.decode(schema.data);
  return protobuf.Root.fromDescriptor(files).lookupType(schema.name);
}

async function main(path) {
  const reader = await McapIndexedReader.Initialize({ readable: new File(path), decompressHandlers });
  const types = new Map();
  for (const [id, schema] of reader.schemasById) types.set(id, decoder(schema));
  const result = { library: reader.header.library, topics: {}, times: [], statistics: Number(reader.statistics.messageCount) };
  const shapes = { lines: 0, triangles: 0, texts: 0, points: 0, ids: [], deletions: 0 };
  for await (const message of reader.readMessages({ validateCrcs: true })) {
    const channel = reader.channelsById.get(message.channelId);
    result.topics[channel.topic] = (result.topics[channel.topic] ?? 0) + 1;
    const decoded = types.get(channel.schemaId).decode(message.data);
    if (channel.topic === "voxeld/scene" && decoded.inSync) result.times.push(String(message.logTime));
    if (channel.topic !== "scene") continue;
    shapes.deletions += decoded.deletions.length;
    for (const entity of decoded.entities) {
      shapes.ids.push(entity.id);
      shapes.lines += entity.lines.length;
      shapes.triangles += entity.triangles.length;
      shapes.texts += entity.texts.length;
      for (const drawn of [...entity.lines, ...entity.triangles]) {
        shapes.points += drawn.points.length;
        if (drawn.indices.some((index) => index >= drawn.points.length)) throw new Error(`${entity.id}: an index is beyond`);
        if (drawn.colors.length !== 0 && drawn.colors.length !== drawn.points.length) throw new Error(`${entity.id}: colours`);
      }
    }
  }
  result.shapes = shapes;
  // Also reads it from front to back, as a truncated file is read.
  const stream = new McapStreamReader({ validateCrcs: true, decompressHandlers });
  stream.append(fs.readFileSync(path));
  let messages = 0;
  for (let record; (record = stream.nextRecord()) !== undefined; ) if (record.type === "Message") messages += 1;
  if (!stream.done() || messages !== result.statistics) throw new Error(`${messages} messages from front to back`);
  console.log(JSON.stringify(result));
}

main(process.argv[2]).catch((error) => {
  console.error(error);
  process.exit(1);
});
