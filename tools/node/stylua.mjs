// SPDX-License-Identifier: GPL-2.0-or-later
//
// stylua as a command: the npm package is its formatter alone, compiled to WebAssembly.
//
//   node stylua.mjs --check FILE...    says which files are not in the format of stylua.toml; status 1 if any
//   node stylua.mjs --write FILE...    puts them into it

import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";

const home = new URL("../../", import.meta.url);
const require = createRequire(new URL(".cache/node/", home));
const { Config, IndentType, LuaVersion, OutputVerification, formatCode } = require("@johnnymorganz/stylua");

function readConfig() {
  const config = Config.new();
  for (const line of readFileSync(new URL("stylua.toml", home), "utf8").split("\n")) {
    const [, key, value] = line.match(/^(\w+) *= *"?([^"#]*?)"? *$/) ?? [];
    switch (key) {
      case undefined:
        if (line.trim() !== "" && !line.startsWith("#")) throw new Error(`stylua.toml: cannot read: ${line}`);
        break;
      case "column_width":
      case "indent_width":
        config[key] = Number(value);
        break;
      case "indent_type":
        config[key] = IndentType[value];
        break;
      case "syntax":
        config[key] = LuaVersion[value];
        break;
      default:
        throw new Error(`stylua.toml: ${key} is not known to tools/node/stylua.mjs`);
    }
  }
  return config;
}

const [mode, ...files] = process.argv.slice(2);
if (mode !== "--check" && mode !== "--write") {
  console.error("stylua: say --check or --write, then files");
  process.exit(2);
}
for (const file of files) {
  const before = readFileSync(file, "utf8");
  let after;
  try {
    after = formatCode(before, readConfig(), undefined, OutputVerification.Full);
  } catch (error) {
    console.error(`${file}: ${error}`);
    process.exitCode = 1;
    continue;
  }
  if (after === before) continue;
  if (mode === "--write") {
    writeFileSync(file, after);
  } else {
    const lines = before.split("\n");
    const first = after.split("\n").findIndex((line, index) => line !== lines[index]);
    console.error(`${file}:${first + 1}: not in the house's format: type  make format`);
    process.exitCode = 1;
  }
}
