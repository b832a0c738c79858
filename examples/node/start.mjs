// What the scripts beside this need of Node.js: onnxruntime-web in one thread, files, and errors in one line.
import { readFile } from "node:fs/promises";
import { webcrypto } from "node:crypto";
import * as ort from "onnxruntime-web";

globalThis.crypto ??= webcrypto;
ort.env.wasm.numThreads = 1;
export { ort };

export async function bytes(path) {
  return new Uint8Array(await readFile(path)); // a copy: its buffer holds the file and nothing else
}

// Prints as JSON what a function makes of the arguments of the command line; else the reason, and exit code 1.
export async function told(make) {
  try {
    console.log(JSON.stringify(await make(process.argv.slice(2))));
  } catch (error) {
    console.error(error.message);
    process.exitCode = 1;
  }
}
