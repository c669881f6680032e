// SPDX-License-Identifier: GPL-2.0-or-later
//
// What Wireshark 4.4.5 compiled to WebAssembly (Lua 5.4) makes of captures, with the dissector of this repository.
//
//   node wiregasm_run.mjs [--plugins FOLDER] CAPTURE...
//
// One JSON object a line. First {"wireshark": "4.4.5", "lua": "Lua 5.4", "scripts": [..]}, then for each capture
// {"capture": path, "packets": n}, and for each of its packets, in order:
//
//   {"number": 1, "protocol": "DALY", "info": "..", "fields": [["daly.kind", "\"frame\""], ..]}
//
// `fields` are the items named daly or daly.*, in the order of the tree, each with its value as a display filter would
// have it (strings quoted), or null where there is none (a protocol, an expert info). Fields without a value of their
// own (FT_NONE) are not told apart from bytes by this Wireshark, and are missing. What Wireshark or Lua complains of
// goes to stderr, and the status is 1.

import { readFileSync, readdirSync } from "node:fs";
import { createRequire } from "node:module";
import { basename, dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const home = new URL("../../", import.meta.url);
const require = createRequire(new URL(".cache/node/", home));
const loaderPath = require.resolve("@goodtools/wiregasm/dist/wiregasm.js");
const loadWiregasm = require(loaderPath);

const captures = process.argv.slice(2);
let plugins = fileURLToPath(new URL("dissector/", home));
if (captures[0] === "--plugins") [, plugins] = captures.splice(0, 2);
if (captures.length === 0) {
  console.error("wiregasm_run: name at least one capture");
  process.exit(2);
}

const emit = (object) => process.stdout.write(JSON.stringify(object) + "\n");
function complain(text) {
  console.error(text);
  process.exitCode = 1;
}
const list = (vector) => Array.from({ length: vector.size() }, (_, index) => vector.get(index));

// Wireshark tells its progress by status messages: 1 is information, the rest (2: error) is trouble.
let program;
const lib = await loadWiregasm({
  locateFile: (path) => join(dirname(loaderPath), path),
  handleStatus: (type, message) => (type === 1 ? undefined : complain(`wiregasm_run: ${message}`)),
  print: (text) => {
    const [, wireshark, lua] = text.match(/^program ([^ ]+) (.*)$/) ?? [];
    if (wireshark === undefined) complain(text);
    else program = { wireshark, lua };
  },
  printErr: (text) => (/ (INFO|MESSAGE|DEBUG|NOISY)\] -- /.test(text) ? undefined : complain(text)),
});

const scripts = readdirSync(plugins).filter((name) => name.endsWith(".lua")).sort();
if (scripts.length === 0) complain(`wiregasm_run: no Lua file in ${plugins}`);
const folder = lib.getPluginsDirectory();
for (const name of scripts) lib.FS.writeFile(`${folder}/${name}`, readFileSync(join(plugins, name)));
lib.FS.writeFile(`${folder}/matrix_program.lua`, 'print("program " .. get_version() .. " " .. _VERSION)');
if (!lib.init() || program === undefined) {
  console.error("wiregasm_run: Wireshark, or its Lua, did not start");
  process.exit(1);
}
emit({ ...program, scripts });

// Depth first, as the tree is drawn. An error of a Lua script at run time is an item of the tree.
function collect(items, into) {
  for (const item of list(items)) {
    const [, name, value] = item.filter.match(/^([\w.]+)(?: == (.*))?$/s) ?? [];
    if (name === "daly" || name?.startsWith("daly.")) into.push([name, value ?? null]);
    if (name?.startsWith("_ws.lua.") && name !== "_ws.lua.text") complain(`wiregasm_run: ${item.label}`);
    collect(item.tree, into);
  }
  return into;
}

const columns = list(lib.getColumns());
for (const capture of captures) {
  const path = `${lib.getUploadDirectory()}/${basename(capture)}`;
  lib.FS.writeFile(path, readFileSync(capture));
  const session = new lib.DissectSession(path);
  const { code, error, summary } = session.load();
  if (code !== 0) {
    complain(`wiregasm_run: ${capture}: ${error || `could not be read (${code})`}`);
    session.delete();
    continue;
  }
  emit({ capture, packets: summary.packet_count });
  const { frames } = session.getFrames("", 0, 0);
  for (const meta of list(frames)) {
    const cells = list(meta.columns);
    const { tree } = session.getFrame(meta.number);
    emit({
      number: meta.number,
      protocol: cells[columns.indexOf("Protocol")],
      info: cells[columns.indexOf("Info")],
      fields: collect(tree, []),
    });
  }
  session.delete();
}
lib.destroy();
