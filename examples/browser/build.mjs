// Puts onnxruntime-web, which npm installed, beside the page: nothing is loaded from another server.
import { cpSync, mkdirSync, readdirSync } from "node:fs";

const from = "node_modules/onnxruntime-web/dist";
mkdirSync("site/ort", { recursive: true });
for (const name of readdirSync(from)) {
  if (name === "ort.wasm.min.mjs" || /^ort-wasm-simd-threaded\.(mjs|wasm)$/.test(name)) cpSync(`${from}/${name}`, `site/ort/${name}`);
}
for (const name of readdirSync(".")) if (/\.(html|js)$/.test(name)) cpSync(name, `site/${name}`);
