// The socket: questions with answers, and what the studio tells by itself.

const waiting = new Map();
const listeners = new Map();
let socket = null;
let number = 0;

/** Call `listener` with every message of a kind: all, project, face, choices, job, corpus, note, open, closed. */
export function on(kind, listener) {
  listeners.set(kind, [...(listeners.get(kind) ?? []), listener]);
}

/** Ask the studio; gives its answer, or throws what it says is wrong. */
export function ask(op, facts = {}) {
  if (!socket || socket.readyState !== WebSocket.OPEN) {
    return Promise.reject(new Error("the studio does not answer; start it again, then reload this page"));
  }
  const id = ++number;
  socket.send(JSON.stringify({ op, id, ...facts }));
  return new Promise((resolve, reject) => waiting.set(id, { resolve, reject }));
}

/** The number that the last question got. */
export const lastNumber = () => number;

export function connect() {
  socket = new WebSocket(`ws://${location.host}/link`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => tell("open", {});
  socket.onmessage = ({ data }) => (typeof data === "string" ? heard(JSON.parse(data)) : heard(unpacked(data)));
  socket.onclose = (event) => {
    for (const { reject } of waiting.values()) reject(new Error("the studio was closed"));
    waiting.clear();
    tell("closed", { reason: event.reason });
    setTimeout(connect, 1500);
  };
}

function heard(message) {
  if (message.kind !== "answer") return tell(message.kind, message);
  const asked = waiting.get(message.id);
  waiting.delete(message.id);
  if (!asked) return undefined;
  return message.ok ? asked.resolve(message) : asked.reject(new Error(message.error));
}

function tell(kind, message) {
  for (const listener of listeners.get(kind) ?? []) listener(message);
}

/** A binary message: uint32 length of the header, the header as JSON, float32 numbers. */
function unpacked(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  return { ...header, numbers: new Float32Array(buffer, 4 + length) };
}
