// Reads an MCAP file with @mcap/core and @foxglove/rosmsg2-serialization (found by NODE_PATH), and prints what it
// holds as JSON: per topic the number of messages, a checksum-like sum of every value, the first stamp and the QoS.
const { McapIndexedReader } = require("@mcap/core");
const { parse } = require("@foxglove/rosmsg");
const { MessageReader } = require("@foxglove/rosmsg2-serialization");
const zstd = require("@foxglove/wasm-zstd");
const { open } = require("node:fs/promises");

function total(value) {
  if (typeof value === "number") return Number.isFinite(value) ? value : 0;
  if (typeof value === "bigint") return Number(value);
  if (ArrayBuffer.isView(value) || Array.isArray(value)) return Array.from(value).reduce((sum, v) => sum + total(v), 0);
  if (value !== null && typeof value === "object") {
    return Object.entries(value).reduce((sum, [key, v]) => (key === "stamp" || key === "map_load_time" ? sum : sum + total(v)), 0);
  }
  return 0;
}

async function main() {
  await zstd.isLoaded;
  const handle = await open(process.argv[2]);
  const readable = {
    size: async () => BigInt((await handle.stat()).size),
    read: async (offset, length) => {
      const buffer = new Uint8Array(Number(length));
      await handle.read(buffer, 0, Number(length), Number(offset));
      return buffer;
    },
  };
  const decompressHandlers = { zstd: (buffer, size) => zstd.decompress(buffer, Number(size)) };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const decoders = new Map();
  const topics = {};
  for await (const message of reader.readMessages()) {
    const channel = reader.channelsById.get(message.channelId);
    const schema = reader.schemasById.get(channel.schemaId);
    if (!decoders.has(schema.id)) {
      decoders.set(schema.id, new MessageReader(parse(new TextDecoder().decode(schema.data), { ros2: true })));
    }
    const decoded = decoders.get(schema.id).readMessage(message.data);
    const entry = (topics[channel.topic] ??= {
      type: schema.name, count: 0, total: 0, first: message.logTime.toString(), qos: channel.metadata.get("offered_qos_profiles"),
    });
    entry.count += 1;
    entry.total += total(decoded);
    entry.last = message.logTime.toString();
  }
  const attachments = [];
  for await (const attachment of reader.readAttachments()) attachments.push(attachment.name);
  console.log(JSON.stringify({ profile: reader.header.profile, topics, attachments }));
}

main().catch((error) => { console.error(error); process.exit(1); });
