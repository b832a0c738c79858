// Exporting a take, and what else runs beside the page.

import { ask, on } from "/page/link.js";
import { store, watch, changed, say } from "/page/store.js";
import { make } from "/page/dom.js";

const dialog = document.getElementById("export-dialog");

export function begin() {
  document.getElementById("export").addEventListener("click", open);
  document.getElementById("export-start").addEventListener("click", start);
  on("job", ({ job }) => {
    const known = store.jobs.get(job.number);
    store.jobs.set(job.number, job);
    if (job.code !== null && known?.code === null) say(job.code === 0 ? `${job.title}: done` : `${job.title}: ${job.lines.at(-1) ?? "ended"}`, job.code !== 0);
    else if (job.code === null) say(`${job.title}: ${job.lines.at(-1) ?? "begins"}`);
    changed("jobs");
  });
  watch("jobs", () => document.getElementById("export-jobs").replaceChildren(...jobRows("export")));
}

const MEANT = {
  ".mp4": "video with sound", ".csv": "weights, head and eyes as Live Link Face writes them", ".glb": "the head with its animation",
  ".npz": "the motion as arrays", ".bvh": "the turns of the head", ".json": "beside the others: why each phone got its motion",
};

function open() {
  const kinds = store.outputs.map((suffix) =>
    make("label", {}, make("input", { type: "checkbox", value: suffix, checked: [".mp4", ".csv"].includes(suffix) }), ` ${suffix}${MEANT[suffix] ? `: ${MEANT[suffix]}` : ""}`));
  document.getElementById("export-kinds").replaceChildren(make("legend", { textContent: "Files" }), ...kinds);
  dialog.showModal();
}

function start(event) {
  event.preventDefault();
  const suffixes = [...document.querySelectorAll("#export-kinds input:checked")].map((box) => box.value);
  ask("export", { line: store.line, take: store.take, suffixes }).catch((error) => say(error.message, true));
}

/** What runs and ran, the newest first. */
export function jobRows(titled = "") {
  return [...store.jobs.values()].reverse().filter((job) => job.title.startsWith(titled)).map((job) => {
    const state = job.code === null ? "running" : job.code === 0 ? "done" : `ended (${job.code})`;
    const files = job.code === 0 && titled ? exported(job.command) : [];
    const cancel = job.code === null ? make("button", { textContent: "Cancel", onclick: () => ask("cancel", { number: job.number }).catch((e) => say(e.message, true)) }) : null;
    return make("div", { className: "job" }, make("strong", { textContent: `${job.title}: ${state} ` }), cancel,
      make("div", {}, make("code", { textContent: job.command })), make("div", { className: "said", textContent: lastSaid(job) }), ...files);
  });
}

/** How far it is, why it ended early, or the end of what it printed; what is printed for a program is shown elsewhere. */
function lastSaid({ code, lines, output }) {
  if (code !== 0) return lines.at(-1) ?? "";
  return output.startsWith("{") ? "" : output.trimEnd().split("\n").slice(-4).join("\n");
}

function exported(command) {
  const names = [...command.matchAll(/(?:-o|--explain) (?:'([^']+)'|(\S+))/g)].map((found) => (found[1] ?? found[2]).split("/").at(-1));
  return names.map((name) => make("div", {}, make("a", { href: `/exports/${encodeURIComponent(name)}`, download: name, textContent: name })));
}
