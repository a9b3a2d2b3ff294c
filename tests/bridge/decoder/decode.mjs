// Decodes messages by the published definitions of ROS 2 Jazzy. In: a line "PACKAGE/TYPE HEX" per message, encapsulation
// included. Out: a line of JSON per message.
import { createInterface } from "node:readline";
import common from "@foxglove/rosmsg-msgs-common";
import serialization from "@foxglove/rosmsg2-serialization";

const known = common.ros2jazzy;

/** The definition of a type, then those of all types in it. */
function definitionsOf(type, seen = new Map()) {
  if (seen.has(type)) return seen;
  seen.set(type, known[type]);
  for (const field of known[type].definitions) {
    if (field.isComplex === true) definitionsOf(field.type, seen);
  }
  return seen;
}

for await (const line of createInterface({ input: process.stdin })) {
  const [type, hex] = line.split(" ");
  const bytes = Uint8Array.from(Buffer.from(hex, "hex"));
  const reader = new serialization.MessageReader([...definitionsOf(type).values()]);
  const plain = (_key, value) => (ArrayBuffer.isView(value) ? Array.from(value) : value);
  console.log(JSON.stringify(reader.readMessage(bytes), plain));
}
